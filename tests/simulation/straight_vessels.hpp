#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <utility>

namespace xraycast {

/// A branch of a hundred stretches.
inline VesselBranch straight(glm::dvec3 from_mm, glm::dvec3 to_mm, double radius_mm, int parent,
                             std::string name = {}) {
  VesselBranch branch;
  branch.parent = parent;
  branch.name = std::move(name);
  constexpr int kStretches = 100;
  for (int i = 0; i <= kStretches; ++i)
    branch.points.push_back({from_mm + (to_mm - from_mm) * (static_cast<double>(i) / kStretches), radius_mm});
  return branch;
}

inline VesselTree::Location place(int branch, double arc_length_mm) {
  VesselTree::Location location;
  location.branch = branch;
  location.arc_length_mm = arc_length_mm;
  return location;
}

}  // namespace xraycast
