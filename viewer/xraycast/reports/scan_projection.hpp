#pragma once

#include "xraycast/scene/canvas.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// A scan along one axis as grey (the mean of its CT numbers along each ray), with labelled voxels over it in
/// colours; row 0 is the most superior slice.
struct ScanProjection {
  int axis;           ///< viewing direction: 0 from the left, 1 from the front
  int width, height;  ///< voxels
  double width_mm, height_mm;
  std::vector<std::uint8_t> rgb;
};

/// `labels` has a number for each voxel: 0 for none, else 1 + the index of its colour. Where a ray crosses
/// several, the first colour shows if it is among them, else the one that the ray crosses longest. Without a
/// volume the grid's labels lie on black.
ScanProjection project_scan(const VolumeGeometry& grid, const Volume* volume,
                            std::span<const std::uint8_t> labels, std::span<const Colour> colours, int axis);
inline ScanProjection project_scan(const Volume& volume, std::span<const std::uint8_t> labels,
                                   std::span<const Colour> colours, int axis) {
  return project_scan(volume.geometry(), &volume, labels, colours, axis);
}

/// Draws a projection as large as fits into a box, in its middle. Returns the box that it fills.
PixelBox draw_projection(Canvas& sheet, const ScanProjection& picture, const PixelBox& box);

}  // namespace xraycast
