#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/vec3.hpp>

#include <optional>
#include <vector>

namespace xraycast {

/// The sac of a saccular aneurysm: a ball beside a vessel, without the cap that the plane of its neck cuts
/// off. In a tree it is a dead end whose name has "aneurysm" in it, as edits make it and phantoms have it:
/// the ball is its widest sphere, and the neck's plane touches the lumen of the vessel that it leaves.
struct AneurysmSac {
  int branch = -1;  ///< of the tree
  glm::dvec3 centre_mm{0, 0, 0};
  double radius_mm = 0;
  glm::dvec3 outwards{0, 0, 1};  ///< unit, from the vessel through the centre
  double neck_mm = 0;            ///< from the centre back to the neck's plane
  double neck_radius_mm = 0;
  double vessel_radius_mm = 0;  ///< of the vessel that it leaves, there

  double volume_mm3() const;
  /// How far a place is within it: from ball and neck, the nearer one. Negative outside.
  double depth_mm(const glm::dvec3& place_mm) const;
  /// The deepest place on its axis, half of the radius or more.
  glm::dvec3 middle_mm() const { return centre_mm + 0.5 * (radius_mm - neck_mm) * outwards; }

  bool operator==(const AneurysmSac&) const = default;
};

/// None for a branch that is no such dead end.
std::optional<AneurysmSac> sac_of(const VesselTree& tree, int branch);

/// All of a tree, by their branches.
std::vector<AneurysmSac> sacs_of(const VesselTree& tree);

}  // namespace xraycast
