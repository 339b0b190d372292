#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec2.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// The body's position in the scan: the default centre and radius of a map.
struct BodyOutline {
  glm::dvec2 centre_mm;     ///< x, y of the centroid of the body's voxels
  double radius_mm;         ///< of a circle about the centre that encloses the body in every slice
  double radius_99_mm = 0;  ///< of one that encloses 99 % of the body's voxels
};

/// Finds the body while the slices are read, on a grid of about 3 mm: everything above -300 HU, opened by
/// about 10 mm in each slice which removes the table's thin shells; the largest connected component is the
/// body.
///
/// Centre and radius are accurate to about one grid step; the radius errs on the large side.
class OutlineFinder {
 public:
  explicit OutlineFinder(const VolumeGeometry& geometry);

  /// Slices in order, from slice 0 on; `hu` holds whole slices.
  void add(std::span<const std::int16_t> hu);

  /// After the last slice. Throws InputError when nothing lies above -300 HU.
  BodyOutline finish() const;

 private:
  VolumeGeometry geometry_;
  Index3 stride_;  ///< in voxels
  Index3 size_;    ///< of the coarse grid
  std::int64_t slices_seen_ = 0;
  std::vector<std::uint8_t> dense_;  ///< 1 above the threshold; x fastest
};

/// The outline of a volume in memory.
BodyOutline find_outline(const Volume& volume);

}  // namespace xraycast
