#pragma once

#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// For every voxel the distance in mm from its centre to the nearest voxel centre outside the mask; 0
/// outside. What lies beyond the grid does not count as outside, so that a vessel that leaves the scan keeps
/// its radius. A mask without any outside has the grid's diagonal everywhere. Exact (Felzenszwalb and
/// Huttenlocher, Distance Transforms of Sampled Functions, 2012).
std::vector<float> distance_to_outside_mm(const Mask& mask);

/// The same to the nearest voxel centre of the mask; 0 in it.
std::vector<float> distance_to_mm(Mask mask);

}  // namespace xraycast
