#pragma once

#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// A vessel mask and its distance transform between voxel centres, by trilinear interpolation. The mask must
/// outlive it.
class Lumen {
 public:
  explicit Lumen(const Mask& mask);

  /// The finest and the coarsest spacing of the grid.
  double voxel_mm() const { return voxel_mm_; }
  double coarsest_mm() const { return coarsest_mm_; }

  /// Whether a point lies between the grid's voxel centres.
  bool contains(const glm::dvec3& point_mm) const;

  /// Radius of the largest sphere around a point that fits in the lumen; half a voxel less than to the next
  /// voxel outside, and at least half a voxel.
  double inscribed_radius_mm(const glm::dvec3& point_mm) const;

  /// From 1 inside to 0 outside; the wall is at one half.
  double occupancy(const glm::dvec3& point_mm) const;

 private:
  const Mask& mask_;
  std::vector<float> distance_mm_;
  double voxel_mm_, coarsest_mm_;
};

/// The cross-section of a vessel's lumen.
struct CrossSection {
  glm::dvec3 to_middle_mm{0, 0, 0};  ///< from the point to the middle of the area that the rays reach
  double radius_mm = 0;              ///< the median of the rays
};

/// Casts rays to the wall in the plane across `tangent`. None goes farther beyond the inscribed sphere than a
/// voxel and a half: where a branch leaves, rays do not meet a wall.
CrossSection cross_section(const Lumen& lumen, const glm::dvec3& point_mm, const glm::dvec3& tangent);

}  // namespace xraycast
