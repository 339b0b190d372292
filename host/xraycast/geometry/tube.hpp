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

/// The same across the chords that reach a radius to each side of their points: a kink that is small beside
/// the radius, as where branches meet, turns no cross-section into its neighbours.
std::vector<Ring> rings_across_chords(std::span<const VesselPoint> points);

}  // namespace xraycast
