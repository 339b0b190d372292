#pragma once

#include "xraycast/volume/slice_stack.hpp"

#include <memory>

namespace xraycast {

/// Interpolates the slices of a stack onto a grid in the frame of VolumeGeometry, however they are sheared,
/// spaced, rotated or scaled: linearly within each of the two slices around a voxel, and linearly between
/// them along their normal. More than half a voxel outside the stack is air.
///
/// Keeps only the stored slices that cross the slices being made, so an axial stack needs two at a time, a
/// tilted one some tens, and only a coronal or sagittal one all of them.
std::unique_ptr<SliceSource> resample(std::unique_ptr<SliceStack> stack, const VolumeGeometry& grid);

}  // namespace xraycast
