#include "xraycast/geometry/moved_vessels.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::moved_vessels_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

HeldMotion held(std::shared_ptr<const Displacement> moves) { return HeldMotion({{{1, std::move(moves)}}}); }

/// Half as wide across x and y and twice as long along z when it has moved, and 5 mm to the left.
HeldMotion stretch() {
  glm::dmat3 back(1);
  back[0][0] = 2;
  back[1][1] = 2;
  back[2][2] = 0.5;
  return held(affine_displacement(back, {-10, 0, 0}));
}

VesselTree forked() {
  VesselBranch trunk, left, right;
  trunk.points = {{{0, 0, 0}, 4}, {{0, 0, 10}, 4}, {{0, 0, 20}, 3}};
  left.points = {{{0, 0, 20}, 2}, {{10, 0, 20}, 2}};
  right.points = {{{0, 0, 20}, 2}, {{-10, 0, 30}, 1}};
  left.parent = right.parent = 0;
  return VesselTree({trunk, left, right}, "tree");
}

TEST(MovedVessels, AreStretchedAsTheBodyIs) {
  const auto [tree, lost] = moved(forked(), stretch());
  EXPECT_EQ(lost.lost, 0);
  EXPECT_EQ(lost.of, 7);
  const std::vector<VesselPoint>& trunk = tree.branches()[0].points;
  // The inverse is exact within 0.0001 mm.
  EXPECT_NEAR(trunk[2].position_mm.x, 5, 1e-3);
  EXPECT_NEAR(trunk[2].position_mm.z, 40, 1e-3);
  // Along z the cross-section is halved both ways; along x halved one way and doubled the other.
  EXPECT_NEAR(trunk[1].radius_mm, 2, 1e-3);
  EXPECT_NEAR(tree.branches()[1].points[0].radius_mm, 2, 1e-3);
  EXPECT_EQ(tree.branches()[1].parent, 0);
}

TEST(MovedVessels, StayWhereTheBodyIsStill) {
  const auto [tree, lost] = moved(forked(), HeldMotion());
  EXPECT_EQ(tree.branches()[2].points[1].position_mm, glm::dvec3(-10, 0, 30));
  EXPECT_EQ(tree.branches()[2].points[1].radius_mm, 1);
  EXPECT_THAT(lost.notes("tree"), IsEmpty());
}

TEST(MovedVessels, HaveSurfacesThatMoveWithThem) {
  Mesh mesh{{{0, 0, 0}, {0, 0, 10}, {10, 0, 20}}, {{0, 1, 2}}};
  const auto [surface, lost] = moved(mesh, stretch());
  EXPECT_EQ(lost.of, 3);
  EXPECT_EQ(surface.triangles, mesh.triangles);
  EXPECT_LT(glm::distance(surface.points_mm[2], glm::vec3(10, 0, 40)), 1e-3);
}

TEST(MovedVessels, TellOfPointsThatHaveNoPlace) {
  class Fold final : public Displacement {
   public:
    glm::dvec3 at(const glm::dvec3& x_mm) const override {
      return {0, 0, 15 * std::tanh(x_mm.z / 4) - x_mm.z};
    }
    bool covers(const glm::dvec3&) const override { return true; }
  };
  const auto [tree, lost] = moved(forked(), held(std::make_shared<Fold>()));
  EXPECT_GT(lost.lost, 0);
  EXPECT_THAT(lost.notes("tree.vtp"),
              ElementsAre(HasSubstr(fmt::format("tree.vtp: {} of 7 points have no place", lost.lost))));
}

}  // namespace
}  // namespace xraycast::moved_vessels_test
