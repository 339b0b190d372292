#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/contrast.hpp"

namespace xraycast {

/// Muscle without contrast agent.
inline constexpr double kSoftTissue_hu = 50;

/// The CT numbers of vessels.
struct HuWindow {
  double low_hu;   ///< at a vessel's edge, by the partial volume of lumen and tissue
  double core_hu;  ///< in a vessel's core
  double high_hu;  ///< above is bone, calcification or metal
};

/// The edge lies halfway from tissue to vessel; the core begins at 70 % of the way, which excludes a weaker
/// filling such as a false lumen's, and ends a quarter of the way or three standard deviations of the noise
/// above the vessels' CT number, whichever is more.
HuWindow window_of(const Contrast& contrast);

/// Voxels of the core, and those down to the edge's CT number that touch one: the partial volume rim is one
/// voxel wide.
Mask threshold(const Volume& volume, const HuWindow& window);

/// The voxels from `low_hu` up to and including `high_hu`.
Mask between(const Volume& volume, double low_hu, double high_hu);

}  // namespace xraycast
