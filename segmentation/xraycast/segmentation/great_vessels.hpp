#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// A great vessel of the trunk.
struct GreatVessel {
  std::string name;      ///< "aorta", or "vena cava", as its place suggests
  glm::dvec3 middle_mm;  ///< on its axis, halfway along what was seen of it, LPS
  double hu;             ///< median over its axis
  double length_mm;      ///< along the patient
};

/// The great vessels of a trunk by place and shape: tubes of 4 to 17 mm radius that run along the patient for
/// 50 mm and more, before the spine and not far from it, brighter than soft tissue, darker than bone, and
/// around most of their circumference brighter than what lies beside them. The leftmost of those that are at
/// least half as long as the longest one comes first: the aorta lies to the left of the vena cava. Empty
/// where there are none, as in a head or a leg.
std::vector<GreatVessel> find_great_vessels(const Volume& volume);

}  // namespace xraycast
