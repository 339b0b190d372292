#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <cmath>

namespace xraycast {

/// Where a point lies beside the piece of a centreline between two of its points, the radius being linear
/// between them.
struct PlaceInTube {
  double fraction;          ///< of the way from the first point to the second, where the axis is nearest
  glm::dvec3 from_axis_mm;  ///< from there
  double radius_mm;         ///< there

  /// How far the point is out of the lumen; negative within.
  double out_mm() const { return glm::length(from_axis_mm) - radius_mm; }
};

inline PlaceInTube place_in_tube(const glm::dvec3& point_mm, const VesselPoint& a, const VesselPoint& b) {
  const glm::dvec3 along = b.position_mm - a.position_mm;
  const double length2 = glm::dot(along, along),
               t = length2 > 0 ? glm::clamp(glm::dot(point_mm - a.position_mm, along) / length2, 0.0, 1.0)
                               : 0;
  return {t, point_mm - glm::mix(a.position_mm, b.position_mm, t), std::lerp(a.radius_mm, b.radius_mm, t)};
}

}  // namespace xraycast
