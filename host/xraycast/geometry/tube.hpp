#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/vec3.hpp>

#include <span>
#include <vector>

namespace xraycast {

/// A cross-section of a tube.
struct Ring {
  glm::dvec3 centre_mm;
  double radius_mm;
  glm::dvec3 normal, binormal;  ///< unit vectors in its plane

  /// The point of the outline at an angle from the normal towards the binormal.
  glm::dvec3 at_mm(double angle_rad) const;
};

/// The cross-sections at the points of a line, two or more, consecutive ones distinct. Frames are parallel
/// transported (no twist); each bisects the directions before and after its point.
std::vector<Ring> rings_along(std::span<const VesselPoint> points);

}  // namespace xraycast
