#include "xraycast/scene/vessel_pick.hpp"

#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/sampling/clip_space.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace xraycast::vessel_pick_test {
namespace {

/// A trunk that forks, and a branch that comes back in front of it (anterior).
VesselTree forked() {
  const auto line = [](const glm::dvec3& from, const glm::dvec3& to, double radius_mm, int parent) {
    VesselBranch branch;
    branch.points = {{from, radius_mm}, {to, radius_mm}};
    branch.parent = parent;
    return branch;
  };
  return VesselTree({line({0, 0, -100}, {0, 0, 0}, 5, -1), line({0, 0, 0}, {60, 0, 60}, 3, 0),
                     line({0, 0, 0}, {-60, 0, 60}, 1, 0), line({60, 0, 60}, {-60, -50, -160}, 2, 1)},
                    "test");
}

View view_at(double angle_deg, std::optional<Cone> cone = {}) {
  return {.lao_rad = angle_deg * std::numbers::pi / 180,
          .cone = cone,
          .width = 400,
          .height = 500,
          .pixel_mm = cone ? 1.5 : 1.0};
}

const std::optional<Cone> kBeams[] = {std::nullopt, Cone{1000, 1500}};

TEST(VesselPick, NamesBranchAndPlaceAtEveryAngle) {
  const VesselTree tree = forked();
  for (const auto& cone : kBeams)
    for (const double angle_deg : {0.0, 25.0, 160.0}) {
      const View view = view_at(angle_deg, cone);
      const auto place = vessel_at(tree, view, pixel_of(view, {30, 0, 30}));
      ASSERT_TRUE(place) << angle_deg;
      EXPECT_EQ(place->branch, 1) << angle_deg;
      // Where the ray enters, three millimetres or less from the middle, obliquely.
      EXPECT_NEAR(place->arc_length_mm, 30 * std::numbers::sqrt2, 3) << angle_deg;
    }
}

TEST(VesselPick, WhatIsNearerToTheDetectorCovers) {
  const VesselTree tree = forked();
  for (const auto& cone : kBeams) {
    // Half-way down the returning branch crosses the trunk, 25 mm in front of it.
    const View front = view_at(0, cone), behind = view_at(180, cone);
    const auto covering = vessel_at(tree, front, pixel_of(front, {0, -25, -50}));
    const auto covered = vessel_at(tree, behind, pixel_of(behind, {0, 0, -50}));
    ASSERT_TRUE(covering && covered);
    EXPECT_EQ(covering->branch, 3);
    EXPECT_EQ(covered->branch, 0);
    EXPECT_NEAR(covered->arc_length_mm, 50, 1);
  }
}

TEST(VesselPick, ThinVesselsAreFoundBesideAndNothingFartherAway) {
  const VesselTree tree = forked();
  for (const auto& cone : kBeams) {
    const View view = view_at(0, cone);
    const glm::dvec2 thin = pixel_of(view, {-30, 0, 30});
    // Its radius is a pixel. At right angles to it, so that the distance is what is said.
    const glm::dvec2 across = glm::dvec2(1, -1) / std::numbers::sqrt2;
    const auto beside = vessel_at(tree, view, thin + 4.0 * across);
    ASSERT_TRUE(beside);
    EXPECT_EQ(beside->branch, 2);
    EXPECT_FALSE(vessel_at(tree, view, thin + 7.0 * across));
    EXPECT_FALSE(vessel_at(tree, view, {5, 5}));
  }
}

TEST(VesselPick, IsDescribedInWords) {
  const VesselTree tree = forked();
  VesselTree::Location place;
  place.branch = 1;
  place.arc_length_mm = 40;
  place.radius_mm = 3;
  EXPECT_EQ(describe(tree, place), "branch 1, 40 of 85 mm, radius 3.0 mm (mean 3.0), from branch 0, into 3");
  place.branch = 0;
  EXPECT_EQ(describe(tree, place), "branch 0, 40 of 100 mm, radius 3.0 mm (mean 5.0), into 1, 2");
  const VesselTree named = with_branch_names(tree, {"aorta", "left iliac artery", "", ""});
  EXPECT_EQ(describe(named, place),
            "aorta, 40 of 100 mm, radius 3.0 mm (mean 5.0), into left iliac artery, 2");
}

}  // namespace
}  // namespace xraycast::vessel_pick_test
