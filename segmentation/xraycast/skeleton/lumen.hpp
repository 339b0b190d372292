#pragma once

#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// The space inside vessels, as the extraction of centrelines asks for it.
class Lumen {
 public:
  virtual ~Lumen() = default;

  /// The finest and the coarsest spacing of the grid on which the vessels' skeleton was found.
  virtual double voxel_mm() const = 0;
  virtual double coarsest_mm() const = 0;

  /// No vessel is taken to be thinner than this.
  virtual double least_radius_mm() const = 0;

  /// Whether something is known of a point.
  virtual bool contains(const glm::dvec3& point_mm) const = 0;

  /// Radius of the largest sphere around a point that fits in the lumen, not less than the least radius.
  virtual double inscribed_radius_mm(const glm::dvec3& point_mm) const = 0;

  /// From 1 inside to 0 outside, falling outwards; the wall is at one half.
  virtual double occupancy(const glm::dvec3& point_mm) const = 0;
};

/// A vessel mask and its distance transform between voxel centres, by trilinear interpolation: the inscribed
/// radius is half a voxel less than the distance to the next voxel outside. The mask must outlive it. Nothing
/// is known beyond the grid's outermost voxel centres.
class MaskLumen : public Lumen {
 public:
  explicit MaskLumen(const Mask& mask);
  explicit MaskLumen(const Mask&&) = delete;

  double voxel_mm() const override { return voxel_mm_; }
  double coarsest_mm() const override { return coarsest_mm_; }
  double least_radius_mm() const override { return 0.5 * voxel_mm_; }
  bool contains(const glm::dvec3& point_mm) const override;
  double inscribed_radius_mm(const glm::dvec3& point_mm) const override;
  double occupancy(const glm::dvec3& point_mm) const override;

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

/// Casts rays to the wall in the plane across `tangent`. Where a branch leaves, rays do not meet a wall: for
/// the middle none goes farther beyond the inscribed sphere than a voxel and a half, and for the radius,
/// which in a flat lumen is more than that sphere's, none beyond twice that or `reach_mm`.
CrossSection cross_section(const Lumen& lumen, const glm::dvec3& point_mm, const glm::dvec3& tangent,
                           double reach_mm = 0);

}  // namespace xraycast
