#include "xraycast/volume/body_outline.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace xraycast::body_outline_test {
namespace {

/// Water where `inside(x_mm, y_mm)`, air elsewhere; 256 x 256 x 30 voxels of 1.5 x 1.5 x 2 mm.
template <typename Inside>
Volume make(const Inside& inside) {
  Volume volume({{256, 256, 30}, {1.5, 1.5, 2}, {-190, -190, 0}});
  const VolumeGeometry& g = volume.geometry();
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z});
        volume.at(x, y, z) = inside(p.x, p.y) ? 0 : -1000;
      }
  return volume;
}

BodyOutline find_outline(const Volume& volume) {
  OutlineFinder finder(volume.geometry());
  finder.add(volume.hu());
  return finder.finish();
}

bool in_trunk(double x, double y) { return std::hypot((x - 20) / 150, (y + 10) / 100) < 1; }
bool in_table(double, double y) { return y > 120 && y < 124; }

// One cell of the outline's grid, which is about 3 mm wide.
constexpr double kCell_mm = 3;

TEST(BodyOutline, CentresOnTheBody) {
  const BodyOutline outline = find_outline(make(in_trunk));
  EXPECT_NEAR(outline.centre_mm.x, 20, kCell_mm);
  EXPECT_NEAR(outline.centre_mm.y, -10, kCell_mm);
}

TEST(BodyOutline, EnclosesTheBodyTightly) {
  const BodyOutline outline = find_outline(make(in_trunk));
  EXPECT_GE(outline.radius_mm, 150 - kCell_mm / 2);
  EXPECT_LE(outline.radius_mm, 150 + kCell_mm);
}

TEST(BodyOutline, TellsAtWhichSidesTheScanCutsIt) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  EXPECT_THAT(find_outline(make(in_trunk)).cut_sides, IsEmpty());
  // Arms that reach beyond the scan on both sides, on one, and one that touches its side in less than 1 cm2.
  const auto with_arms = [](double from, double to, double half_mm) {
    return make(
        [=](double x, double y) { return in_trunk(x, y) || (std::abs(y) < half_mm && x > from && x < to); });
  };
  EXPECT_THAT(find_outline(with_arms(-300, 300, 20)).cut_sides, ElementsAre("right", "left"));
  EXPECT_THAT(find_outline(with_arms(0, 300, 20)).cut_sides, ElementsAre("left"));
  EXPECT_THAT(find_outline(with_arms(0, 300, 0.5)).cut_sides, IsEmpty());
  EXPECT_THAT(find_outline(make([](double x, double y) { return std::abs(x) < 100 && y < 0; })).cut_sides,
              ElementsAre("anterior"));
  EXPECT_THAT(find_outline(make([](double, double) { return true; })).cut_sides, IsEmpty());
}

TEST(BodyOutline, TellsHowFarMostOfTheBodyReaches) {
  // A disc, of which 99 % lie within 0.995 of its radius.
  const BodyOutline disc = find_outline(make([](double x, double y) { return std::hypot(x, y) < 120; }));
  EXPECT_NEAR(disc.radius_99_mm, 0.995 * 120, kCell_mm);
  EXPECT_LT(disc.radius_99_mm, disc.radius_mm);
  // Beside it an arm that holds less than a hundredth of the whole.
  const BodyOutline with_arm = find_outline(make(
      [](double x, double y) { return std::hypot(x, y) < 120 || (std::abs(y) < 10 && x > 100 && x < 140); }));
  EXPECT_NEAR(with_arm.radius_99_mm, 120, kCell_mm);
  EXPECT_NEAR(with_arm.radius_mm, 140, kCell_mm);
}

TEST(BodyOutline, LeavesTheTableOut) {
  const auto with_table = make([](double x, double y) { return in_trunk(x, y) || in_table(x, y); });
  const BodyOutline outline = find_outline(with_table), bare = find_outline(make(in_trunk));
  EXPECT_EQ(outline.centre_mm, bare.centre_mm);
  EXPECT_EQ(outline.radius_mm, bare.radius_mm);
}

TEST(BodyOutline, LeavesTheTableOutWhereTheBodyLiesOnIt) {
  const auto with_table = make([](double x, double y) { return in_trunk(x, y) || (y > 88 && y < 92); });
  EXPECT_LE(find_outline(with_table).radius_mm, 150 + kCell_mm);
}

/// Of 60 mm of z.
TEST(BodyOutline, ArmsBesideTheTrunkBelongToIt) {
  const auto at = [](double x, double y, double middle, double radius) {
    return std::hypot(x - middle, y) < radius;
  };
  const auto both = make([&](double x, double y) {
    return std::hypot(x / 100, y / 90) < 1 || at(x, y, -150, 30) || at(x, y, 150, 35) || in_table(x, y);
  });
  const BodyOutline with_arms = find_outline(both);
  EXPECT_EQ(with_arms.limbs, 2);
  EXPECT_NEAR(with_arms.radius_mm, 185, kCell_mm);
  const BodyOutline with_one = find_outline(
      make([&](double x, double y) { return std::hypot(x / 100, y / 90) < 1 || at(x, y, 150, 35); }));
  EXPECT_EQ(with_one.limbs, 1);
  EXPECT_NEAR(with_one.centre_mm.x, 0, kCell_mm);  // the trunk's, also where one arm is missing
  // No limbs: a tube of a line, a thick tabletop, the hollow frame of a table.
  const auto without = find_outline(make([&](double x, double y) {
    return std::hypot(x / 100, y / 90) < 1 || at(x, y, 150, 8) || (std::abs(x) < 160 && y > 110 && y < 130) ||
           (at(x, y, -150, 34) && !at(x, y, -150, 24));
  }));
  EXPECT_EQ(without.limbs, 0);
  EXPECT_NEAR(without.radius_mm, 100, kCell_mm);
}

TEST(BodyOutline, TellsHowTheBodyLeans) {
  Volume volume({{128, 128, 100}, {3, 3, 3}, {-190, -190, 0}});
  const VolumeGeometry& g = volume.geometry();
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z});
        volume.at(x, y, z) =
            std::hypot((p.x - 0.3 * (p.z - 150)) / 100, (p.y + 0.1 * (p.z - 150)) / 70) < 1 ? 0 : -1000;
      }
  const BodyOutline outline = find_outline(volume);
  // Cells of 3 mm over 300 mm.
  EXPECT_NEAR(outline.lean.x, 0.3, 0.01);
  EXPECT_NEAR(outline.lean.y, -0.1, 0.01);
  EXPECT_EQ(find_outline(make(in_trunk)).lean, glm::dvec2(0));  // 60 mm are too short to say
}

TEST(BodyOutline, SlicesInRunsGiveTheSame) {
  const Volume volume = make(in_trunk);
  OutlineFinder finder(volume.geometry());
  for (std::int64_t z = 0; z < 30; z += 7) finder.add(volume.slices(z, std::min<std::int64_t>(7, 30 - z)));
  EXPECT_EQ(finder.finish().centre_mm, find_outline(volume).centre_mm);
}

TEST(BodyOutline, AirAloneIsRefused) {
  EXPECT_THROW(find_outline(make([](double, double) { return false; })), InputError);
}

}  // namespace
}  // namespace xraycast::body_outline_test
