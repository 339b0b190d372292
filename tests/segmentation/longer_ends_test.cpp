// Vessels that go on beyond the ends of a tree: bent tubes by a seed in soft tissue, of which the tree has
// the first half.
#include "xraycast/radii/longer_ends.hpp"

#include "support/tubes.hpp"
#include "xraycast/radii/image_radii.hpp"
#include "xraycast/radii/lumen_of_lines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace xraycast::longer_ends_test {
namespace {

constexpr double kVoxel_mm = 0.8, kTissue_hu = 60;

/// A vessel along an arc in tissue, with fat to the left; radius, bend and noise by the seed.
class BentVessel {
 public:
  explicit BentVessel(std::uint32_t seed, const glm::dvec3& spacing_mm = glm::dvec3(kVoxel_mm))
      : random_(seed), geometry_{.size = Index3(glm::ceil(56.0 / spacing_mm)), .spacing_mm = spacing_mm} {
    bend_mm_ = 30 + 60 * share();
    radius_mm_ = kVoxel_mm * (1.6 + 1.4 * share());
    const double turn = 2 * std::numbers::pi * share();
    across_ = {std::cos(turn), std::sin(turn), 0};
    noise_hu_ = 5 + 20 * share();
  }

  double radius_mm() const { return radius_mm_; }
  /// At right angles to the arc's plane.
  glm::dvec3 aside() const { return glm::cross(across_, glm::dvec3(0, 0, 1)); }
  double noise_hu() const { return noise_hu_; }
  /// Fat on one side of the arc's plane, from so many radii beside the axis on, in the place of that to the
  /// left.
  void lie_beside_fat(double radii) { fat_from_mm_ = radii * radius_mm_; }
  static constexpr double kLength_mm = 44;

  /// At a distance from the arc's begin; its middle is that of the scan.
  glm::dvec3 at(double along_mm) const {
    const glm::dvec3 middle = geometry_.to_world_mm(0.5 * glm::dvec3(geometry_.size - Index3(1)));
    const double angle = (along_mm - 0.5 * kLength_mm) / bend_mm_;
    return middle + bend_mm_ * (std::sin(angle) * glm::dvec3(0, 0, 1) + (1 - std::cos(angle)) * across_);
  }

  /// From the arc.
  double off_mm(const VesselPoint& p) const {
    double least_mm = 1e9;
    for (double mm = 0; mm < kLength_mm; mm += 0.1)
      least_mm = std::min(least_mm, glm::distance(p.position_mm, at(mm)));
    return least_mm;
  }

  std::vector<VesselPoint> line(double from_mm, double to_mm) const {
    std::vector<VesselPoint> points;
    for (double mm = from_mm; mm <= to_mm; mm += 0.7) points.push_back({at(mm), radius_mm_});
    return points;
  }

  VesselTree tree(double from_mm, double to_mm) const {
    return {{{line(from_mm, to_mm), -1, {}, {}}}, "bent"};
  }

  /// The lumen of the arc up to a length, in tissue, with fat on one side.
  Volume scan(double to_mm, double lumen_hu = 180, double around_hu = kTissue_hu) {
    constexpr double kFat_hu = -90;
    constexpr int kSub = 3;
    std::normal_distribution<double> normal;
    Volume volume(geometry_);
    for (std::int64_t z = 0; z < geometry_.size.z; ++z)
      for (std::int64_t y = 0; y < geometry_.size.y; ++y)
        for (std::int64_t x = 0; x < geometry_.size.x; ++x) {
          int inside = 0;
          for (int k = 0; k < kSub * kSub * kSub; ++k) {
            const glm::dvec3 sub(k % kSub, k / kSub % kSub, k / (kSub * kSub));
            inside += is_inside(geometry_.to_world_mm(glm::dvec3(x, y, z) + (sub - 1.0) / 3.0), to_mm);
          }
          const double beside_mm = glm::dot(geometry_.to_world_mm(glm::dvec3(x, y, z)) - at(0), aside());
          const bool is_fat =
              fat_from_mm_ ? beside_mm > *fat_from_mm_ : around_hu == kTissue_hu && x < geometry_.size.x / 4;
          volume.at(x, y, z) = static_cast<std::int16_t>(
              std::lround(std::lerp(is_fat ? kFat_hu : around_hu, lumen_hu, inside / std::pow(kSub, 3)) +
                          noise_hu_ * normal(random_)));
        }
    return volume;
  }

  MeasuredTree measured(const VesselTree& tree, const Volume& volume,
                        const ScanResponse* response = nullptr) const {
    Progress unheard;
    return with_image_radii(tree, {volume, noise_hu_, response}, "bent", unheard);
  }

  /// The tree as with_longer_ends gives it.
  LongerEnds longer(const VesselTree& tree, const Volume& volume,
                    const ScanResponse* response = nullptr) const {
    Progress unheard;
    const auto [given, brightness] = measured(tree, volume, response);
    if (!brightness) return {given, {}};
    return with_longer_ends(given, {volume, noise_hu_, response}, *brightness, "bent", unheard);
  }

 private:
  /// Whether a point lies in the lumen, which ends round.
  bool is_inside(const glm::dvec3& p, double to_mm) const {
    const glm::dvec3 from = p - (at(0.5 * kLength_mm) + bend_mm_ * across_);
    const double z = from.z, inwards = -glm::dot(from, across_),
                 along_mm = bend_mm_ * std::atan2(z, inwards) + 0.5 * kLength_mm;
    if (along_mm < 0 || along_mm > to_mm) return glm::distance(p, at(along_mm < 0 ? 0 : to_mm)) < radius_mm_;
    const double out = glm::dot(from, aside());
    return std::hypot(std::hypot(z, inwards) - bend_mm_, out) < radius_mm_;
  }

  double share() { return (static_cast<double>(random_()) + 0.5) / 4294967296.0; }

  std::mt19937 random_;
  VolumeGeometry geometry_;
  double bend_mm_, radius_mm_, noise_hu_;
  glm::dvec3 across_;
  std::optional<double> fat_from_mm_;
};

class LongerEndsOf : public testing::TestWithParam<std::uint32_t> {};

TEST_P(LongerEndsOf, AHalfTreeReachTheVesselsEnd) {
  BentVessel vessel(GetParam());
  constexpr double kEnd_mm = 40, kHalf_mm = 22;
  const LongerEnds found = vessel.longer(vessel.tree(0, kHalf_mm), vessel.scan(kEnd_mm));
  ASSERT_EQ(found.followed.size(), 1U);
  const VesselBranch& branch = found.tree.branches()[0];
  // As near as ends of a tree are to be.
  EXPECT_LT(glm::distance(branch.points.back().position_mm, vessel.at(kEnd_mm)), 3);
  EXPECT_EQ(branch.points.front().position_mm, vessel.at(0));
  for (const VesselPoint& p : branch.points)
    EXPECT_LT(vessel.off_mm(p), kVoxel_mm);  // what a step may be off
  // No wider than before the end; about its end, a window shows less and less of the vessel.
  for (const VesselPoint& p : found.followed[0]) {
    EXPECT_LT(p.radius_mm, 1.1 * vessel.radius_mm());
    EXPECT_GT(p.radius_mm, 0.7 * vessel.radius_mm());
  }
}

TEST_P(LongerEndsOf, AVesselBesideFatReachItsEnd) {
  // From fat about most of the vessel to fat behind a layer of tissue.
  for (const double radii : {-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0}) {
    BentVessel vessel(GetParam());
    vessel.lie_beside_fat(radii);
    constexpr double kEnd_mm = 40, kHalf_mm = 22;
    const LongerEnds found = vessel.longer(vessel.tree(0, kHalf_mm), vessel.scan(kEnd_mm));
    ASSERT_EQ(found.followed.size(), 1U) << radii;
    EXPECT_LT(glm::distance(found.followed[0].back().position_mm, vessel.at(kEnd_mm)), 3) << radii;
    for (const VesselPoint& p : found.followed[0]) {
      EXPECT_LT(vessel.off_mm(p), 1.2 * kVoxel_mm) << radii;  // measured 1.04
      EXPECT_GT(p.radius_mm, 0.7 * vessel.radius_mm()) << radii;
    }
  }
}

TEST_P(LongerEndsOf, AWholeTreeAreThoseThatItHas) {
  BentVessel vessel(GetParam());
  constexpr double kEnd_mm = 38;
  const VesselTree tree = vessel.tree(0, kEnd_mm);
  EXPECT_TRUE(vessel.longer(tree, vessel.scan(kEnd_mm)).followed.empty());
}

TEST_P(LongerEndsOf, AMiddlePieceReachOneEndAndKeepTheRoot) {
  BentVessel vessel(GetParam());
  const VesselTree tree = vessel.tree(10, 28);
  const LongerEnds found = vessel.longer(tree, vessel.scan(42));
  ASSERT_EQ(found.followed.size(), 1U);
  const VesselBranch& branch = found.tree.branches()[0];
  EXPECT_EQ(branch.points.front().position_mm, tree.branches()[0].points.front().position_mm);
  EXPECT_LT(glm::distance(branch.points.back().position_mm, vessel.at(42)), 3);
}

TEST_P(LongerEndsOf, AVesselThatLosesItsContrastStay) {
  BentVessel vessel(GetParam());
  const VesselTree tree = vessel.tree(0, 22);
  const Volume bright = vessel.scan(22);
  ASSERT_TRUE(vessel.measured(tree, bright).brightness);
  EXPECT_TRUE(vessel.longer(tree, bright).followed.empty());
}

TEST_P(LongerEndsOf, AVesselBeyondWhichAnotherOneLiesEndBeforeThat) {
  BentVessel vessel(GetParam());
  // The other one crosses the arc at 34 mm; they hang together far beside it.
  const glm::dvec3 at = vessel.at(34), away = 20.0 * vessel.aside();
  const std::vector<VesselBranch> branches{
      {{{at - away, 3}, {at + away, 3}}, -1, {}, {}},
      {{{at + away, 1}, {vessel.at(0) + away, 1}, {vessel.at(0), 1}}, 0, {}, {}},
      {vessel.line(0, 22), 1, {}, {}}};
  const Volume scan = vessel.scan(42);
  const auto brightness = vessel.measured(vessel.tree(0, 22), scan).brightness;
  ASSERT_TRUE(brightness);
  Progress unheard;
  const LongerEnds found =
      with_longer_ends({branches, "two"}, {scan, vessel.noise_hu()}, *brightness, "two", unheard);
  ASSERT_EQ(found.followed.size(), 1U);
  for (const VesselPoint& p : found.followed[0])
    EXPECT_GT(distance_to_segment(p.position_mm, at - away, at + away), 3);
}

TEST(LongerEndsOfThickSlices, Stay) {
  BentVessel vessel(700, {2.4, 0.8, 0.8});  // across which the vessel runs
  EXPECT_TRUE(vessel.longer(vessel.tree(0, 22), vessel.scan(40)).followed.empty());
}

TEST(LongerEndsOfAScanWithoutABackground, ReachTheVesselsEnd) {
  // Noise below the background is cut off.
  BentVessel vessel(701);
  Volume scan = vessel.scan(40, 180, -400);
  for (std::int16_t& hu : scan.hu()) hu = std::max<std::int16_t>(hu, -400);
  const ScanResponse response(scan, vessel.noise_hu());
  ASSERT_TRUE(response.is_cut_off());
  const LongerEnds found = vessel.longer(vessel.tree(0, 22), scan, &response);
  ASSERT_EQ(found.followed.size(), 1U);
  EXPECT_LT(glm::distance(found.tree.branches()[0].points.back().position_mm, vessel.at(40)), 3);
  // Nothing goes on in the background.
  EXPECT_TRUE(vessel.longer(vessel.tree(0, 40), scan, &response).followed.empty());
}

INSTANTIATE_TEST_SUITE_P(BySeed, LongerEndsOf, testing::Range(700U, 704U),
                         [](const auto& at) { return "Seed" + std::to_string(at.param); });

TEST(LumenOfLines, IsThatOfTubes) {
  const VolumeGeometry geometry{.size = {40, 40, 40}, .spacing_mm = {0.5, 0.5, 0.8}};
  for (const double radius_mm : {0.9, 2.0}) {
    Mask mask(geometry);
    LumenFill fill(geometry);
    add_lumen_of_lines({{{{5, 5, 8}, radius_mm}, {{10, 12, 16}, radius_mm}, {{12, 12, 24}, radius_mm}}}, mask,
                       fill);
    const double length_mm = std::sqrt(25 + 49 + 64.0) + std::sqrt(4 + 64.0),
                 volume_mm3 = std::numbers::pi * radius_mm * radius_mm * (length_mm + 4.0 / 3 * radius_mm);
    // A bend's corner, and walls taken for flat.
    EXPECT_NEAR(fill.volume_mm3(), volume_mm3, 0.06 * volume_mm3) << radius_mm;
    EXPECT_NEAR(static_cast<double>(mask.count()) * 0.2, volume_mm3, 0.06 * volume_mm3) << radius_mm;
  }
}

TEST(LumenOfLines, HangsTogetherHoweverThin) {
  const VolumeGeometry geometry{.size = {20, 20, 20}, .spacing_mm = glm::dvec3(1)};
  Mask mask(geometry);
  LumenFill fill(geometry);
  constexpr double kRadius_mm = 0.4;
  add_lumen_of_lines({{{{4.6, 5, 5}, kRadius_mm}, {{5.4, 15, 5}, kRadius_mm}}}, mask, fill);
  for (std::int64_t y = 5; y <= 15; ++y) EXPECT_TRUE((mask[{5, y, 5}])) << y;
  // Half of a voxel each. Of a tube so thin a flat wall tells within a third.
  EXPECT_NEAR(fill.volume_mm3(), std::numbers::pi * kRadius_mm * kRadius_mm * 10.5, 1.8);
}

TEST(LumenOfLines, EndsAtTheScansSide) {
  const VolumeGeometry geometry{.size = {10, 10, 10}, .spacing_mm = glm::dvec3(1)};
  Mask mask(geometry);
  LumenFill fill(geometry);
  add_lumen_of_lines({{{{-20, 5, 5}, 2.1}, {{30, 5, 5}, 2.1}}, {{{50, 50, 50}, 2}, {{60, 60, 60}, 2}}}, mask,
                     fill);
  EXPECT_EQ(mask.count(), 10 * 13);  // thirteen voxels' centres lie within the circle
}

}  // namespace
}  // namespace xraycast::longer_ends_test
