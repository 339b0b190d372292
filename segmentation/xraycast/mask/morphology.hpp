#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/mask/slice_morphology.hpp"

namespace xraycast {

MaskSlice slice_of(Mask& mask, std::int64_t z);

bool is_empty(const MaskSlice& slice);

/// A structuring element within a slice: a disc of a radius in mm; at least a voxel.
StructuringElement disc(const VolumeGeometry& grid, double radius_mm);

/// Dilation by a voxel's neighbours: the mask and what touches it.
Mask dilated(const Mask& mask, Sharing sharing);

/// Erosion by a voxel's neighbours: the voxels of a mask that touch none outside of it. Beyond the grid
/// nothing is outside.
Mask eroded(const Mask& mask, Sharing sharing);

/// Dilation by a cylinder that stands on the slices: a disc of that radius, as far above and below.
Mask dilated_by_cylinder(const Mask& mask, double radius_mm);

/// Fills the holes of a mask within each slice up to `max_area_mm2`.
void fill_holes(Mask& mask, double max_area_mm2);

}  // namespace xraycast
