#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// Thins a mask to its skeleton, one voxel wide, in six directional passes per layer (Lee, Kashyap and Chu,
/// Building skeleton models via 3-D medial surface/axis thinning algorithms, 1994). Only simple points are
/// deleted, one after the other, so that components, tunnels and cavities, and with them the Euler
/// characteristic, are preserved. End points of lines are kept. `progress` counts the deleted voxels, which
/// stay below its total.
///
/// A straight line along an axis that is two voxels wide lies with its whole length on the border across it.
/// The original method deletes it from one end on, as does `shrink`, with which the steps of a segmentation
/// agree; `keep` keeps its length.
enum class StraightLines { shrink, keep };
Mask thin(const Mask& mask, Progress& progress, StraightLines straight = StraightLines::shrink);
inline Mask thin(const Mask& mask, StraightLines straight = StraightLines::shrink) {
  Progress unheard;
  return thin(mask, unheard, straight);
}

}  // namespace xraycast
