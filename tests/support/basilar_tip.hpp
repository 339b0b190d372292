#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast::test {

/// A vessel of 100 mm, upwards, that forks around an aneurysm of 10 mm straight ahead, as at a basilar
/// artery's tip. The neck's plane is 2 mm beyond the fork.
inline VesselTree basilar_tip() {
  const auto line = [](glm::dvec3 from_mm, glm::dvec3 to_mm, double radius_mm, int parent, const char* name) {
    VesselBranch branch;
    branch.parent = parent;
    branch.name = name;
    constexpr int kStretches = 40;
    for (int i = 0; i <= kStretches; ++i)
      branch.points.push_back(
          {from_mm + (to_mm - from_mm) * (static_cast<double>(i) / kStretches), radius_mm});
    return branch;
  };
  VesselBranch sac;
  sac.parent = 0;
  sac.name = "aneurysm";
  const double to_centre_mm = 2 + std::sqrt(25 - 6.25);
  constexpr int kInner = 24;
  for (int i = 0; i <= 3 * kInner / 2; ++i) {
    const double at_mm = to_centre_mm * i / kInner;
    sac.points.push_back({{0, 0, 100 + at_mm}, std::max(1.0, 5 - std::abs(at_mm - to_centre_mm))});
  }
  return VesselTree({line({0, 0, 0}, {0, 0, 100}, 2, -1, "basilar artery"),
                     line({0, 0, 100}, {40, 0, 110}, 1.5, 0, "right artery"),
                     line({0, 0, 100}, {-40, 0, 110}, 1.5, 0, "left artery"), sac},
                    "test");
}

}  // namespace xraycast::test
