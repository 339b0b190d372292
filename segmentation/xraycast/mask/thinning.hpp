#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// Thins a mask to its skeleton, one voxel wide, in six directional passes per layer (Lee, Kashyap and Chu,
/// Building skeleton models via 3-D medial surface/axis thinning algorithms, 1994). Only simple points are
/// deleted, one after the other, so that components, tunnels and cavities, and with them the Euler
/// characteristic, are preserved. End points of lines are kept. `progress` counts the deleted voxels, which
/// stay below its total.
Mask thin(const Mask& mask, Progress& progress);
inline Mask thin(const Mask& mask) {
  Progress unheard;
  return thin(mask, unheard);
}

}  // namespace xraycast
