#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/threshold.hpp"

namespace xraycast {

/// Adds the outermost voxels of a lumen that were removed with the rim of bone beside it: `bright` voxels
/// that share a face with it.
void add_partial_volume_rim(const Mask& bright, Mask& vessels);

/// Adds voxels denser than a vessel within 1.5 mm of one that are not bone: plaques in its wall, and a
/// stent's struts and their blooming.
void add_dense_wall(const Volume& volume, const HuWindow& window, const Mask& bone, Mask& vessels);

/// Adds the voxels around a mask that its lumen fills by half or more: those that are brighter than halfway
/// from the darkest voxel around them to the lumen's own brightness, which is that of the mask's voxels
/// beside them. `excluded` stays out.
void add_half_filled_rim(const Volume& scan, const Mask& excluded, Mask& vessels);

}  // namespace xraycast
