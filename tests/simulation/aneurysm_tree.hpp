#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace xraycast::test {

/// A vessel of 120 mm and 4 mm, upwards, with a ball beside its middle whose neck is 5 mm wide, in
/// radiologists' words a sidewall aneurysm, made as edits make it.
struct AneurysmTree {
  static constexpr double kVessel_mm = 2, kNeck_mm = 2.5, kLength_mm = 120;
  double ball_mm = 5;  ///< radius
  glm::dvec3 outwards{1, 0, 0};

  /// From the vessel's axis: the neck's plane touches the lumen.
  double to_centre_mm() const { return kVessel_mm + std::sqrt(ball_mm * ball_mm - kNeck_mm * kNeck_mm); }
  glm::dvec3 centre_mm() const {
    return glm::dvec3(0, 0, 0.5 * kLength_mm) + to_centre_mm() * glm::normalize(outwards);
  }

  static VesselBranch straight(double from_mm, double to_mm, int parent) {
    VesselBranch branch;
    branch.parent = parent;
    branch.name = "carotid";
    constexpr int kStretches = 60;
    for (int i = 0; i <= kStretches; ++i)
      branch.points.push_back(
          {{0, 0, std::lerp(from_mm, to_mm, static_cast<double>(i) / kStretches)}, kVessel_mm});
    return branch;
  }

  VesselTree tree() const {
    VesselBranch sac;
    sac.parent = 0;
    sac.name = "aneurysm";
    constexpr int kStretches = 24;
    const double end_mm = to_centre_mm() + 0.5 * ball_mm;
    const glm::dvec3 root_mm{0, 0, 0.5 * kLength_mm};
    for (int i = 0; i <= 3 * kStretches / 2; ++i) {
      const double at_mm = i <= kStretches
                               ? to_centre_mm() * i / kStretches
                               : std::lerp(to_centre_mm(), end_mm, 2.0 * (i - kStretches) / kStretches);
      sac.points.push_back({root_mm + at_mm * glm::normalize(outwards),
                            std::max(0.5 * kVessel_mm, ball_mm - std::abs(at_mm - to_centre_mm()))});
    }
    return VesselTree({straight(0, 0.5 * kLength_mm, -1), straight(0.5 * kLength_mm, kLength_mm, 0), sac},
                      "test");
  }
};

}  // namespace xraycast::test
