#pragma once

#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// Euclidean distance transform: for every voxel the distance from its centre to the nearest voxel centre of
/// the background; 0 in the background. Outside the grid there is no background, so that a vessel that leaves
/// the scan keeps its radius. A mask without background has the grid's diagonal everywhere. Exact
/// (Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions, 2012).
std::vector<float> distance_to_background_mm(const Mask& mask);

/// The same to the nearest voxel centre of the mask; 0 in it.
std::vector<float> distance_to_foreground_mm(Mask mask);

/// The voxels of a mask in the order of their distances, the deepest first.
std::vector<std::size_t> deepest_first(const Mask& mask, const std::vector<float>& distance_mm);

}  // namespace xraycast
