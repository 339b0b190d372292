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
#include <random>
#include <string>
#include <vector>

namespace xraycast::longer_ends_test {
namespace {

constexpr double kVoxel_mm = 0.8;

/// A vessel along an arc, thinner towards its end, beside a wide one that tells the lumen's brightness.
class BentVessel {
 public:
  explicit BentVessel(std::uint32_t seed)
      : random_(seed), geometry_{.size = {70, 70, 70}, .spacing_mm = glm::dvec3(kVoxel_mm)} {
    bend_mm_ = 30 + 60 * share();
    radius_mm_ = kVoxel_mm * (1.6 + 1.4 * share());
    const double turn = 2 * std::numbers::pi * share();
    across_ = {std::cos(turn), std::sin(turn), 0};
    noise_hu_ = 5 + 20 * share();
  }

  const VolumeGeometry& geometry() const { return geometry_; }
  double radius_mm() const { return radius_mm_; }
  static constexpr double kLength_mm = 44;

  /// At a distance from the arc's begin; its middle is that of the scan.
  glm::dvec3 at(double along_mm) const {
    const glm::dvec3 middle = geometry_.to_world_mm(0.5 * glm::dvec3(geometry_.size - Index3(1)));
    const double angle = (along_mm - 0.5 * kLength_mm) / bend_mm_;
    return middle + bend_mm_ * (std::sin(angle) * glm::dvec3(0, 0, 1) + (1 - std::cos(angle)) * across_);
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
  Volume scan(double to_mm, double lumen_hu = 180) {
    constexpr double kTissue_hu = 60, kFat_hu = -90;
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
          const double around_hu = x < geometry_.size.x / 4 ? kFat_hu : kTissue_hu;
          volume.at(x, y, z) = static_cast<std::int16_t>(std::lround(
              std::lerp(around_hu, lumen_hu, inside / std::pow(kSub, 3)) + noise_hu_ * normal(random_)));
        }
    return volume;
  }

  /// The tree as with_longer_ends gives it.
  LongerEnds longer(const VesselTree& tree, const Volume& volume) const {
    Progress unheard;
    const ScanOfVessels scan{volume, noise_hu_};
    const MeasuredTree measured = with_image_radii(tree, scan, "bent", unheard);
    if (!measured.brightness) return {tree, {}};
    return with_longer_ends(measured.tree, scan, *measured.brightness, "bent", unheard);
  }

 private:
  /// Whether a point lies in the lumen, which ends round.
  bool is_inside(const glm::dvec3& p, double to_mm) const {
    const glm::dvec3 from = p - (at(0.5 * kLength_mm) + bend_mm_ * across_);
    const double z = from.z, inwards = -glm::dot(from, across_),
                 along_mm = bend_mm_ * std::atan2(z, inwards) + 0.5 * kLength_mm;
    if (along_mm < 0 || along_mm > to_mm) return glm::distance(p, at(along_mm < 0 ? 0 : to_mm)) < radius_mm_;
    const double out = glm::dot(from, glm::cross(across_, glm::dvec3(0, 0, 1)));
    return std::hypot(std::hypot(z, inwards) - bend_mm_, out) < radius_mm_;
  }

  double share() { return (static_cast<double>(random_()) + 0.5) / 4294967296.0; }

  std::mt19937 random_;
  VolumeGeometry geometry_;
  double bend_mm_, radius_mm_, noise_hu_;
  glm::dvec3 across_;
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
  for (const VesselPoint& p : branch.points) {
    double off_mm = 1e9;
    for (double mm = 0; mm < BentVessel::kLength_mm; mm += 0.1)
      off_mm = std::min(off_mm, glm::distance(p.position_mm, vessel.at(mm)));
    EXPECT_LT(off_mm, kVoxel_mm);
  }
  for (const VesselPoint& p : found.followed[0]) {
    EXPECT_LT(p.radius_mm, 1.3 * vessel.radius_mm());
    EXPECT_GT(p.radius_mm, 0.6 * vessel.radius_mm());
  }
}

TEST_P(LongerEndsOf, AWholeTreeAreThoseThatItHas) {
  BentVessel vessel(GetParam());
  constexpr double kEnd_mm = 38;
  const VesselTree tree = vessel.tree(0, kEnd_mm);
  const LongerEnds found = vessel.longer(tree, vessel.scan(kEnd_mm));
  // An end is known to within half a window: 2.5 voxels.
  EXPECT_LT(found.tree.branches()[0].arc_length_mm.back(),
            tree.branches()[0].arc_length_mm.back() + 2.5 * kVoxel_mm);
}

TEST_P(LongerEndsOf, TheRootReachTheVesselsBegin) {
  BentVessel vessel(GetParam());
  const LongerEnds found = vessel.longer(vessel.tree(20, 40), vessel.scan(40));
  ASSERT_EQ(found.followed.size(), 1U);
  const VesselBranch& branch = found.tree.branches()[0];
  EXPECT_LT(glm::distance(branch.points.front().position_mm, vessel.at(0)), 3);
  EXPECT_LT(glm::distance(branch.points.back().position_mm, vessel.at(40)), 1.5);
}

TEST_P(LongerEndsOf, AVesselWithoutContrastStay) {
  BentVessel vessel(GetParam());
  const VesselTree tree = vessel.tree(0, 22);
  EXPECT_TRUE(vessel.longer(tree, vessel.scan(40, 60)).followed.empty());
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

TEST(LumenOfLines, EndsAtTheScansSide) {
  const VolumeGeometry geometry{.size = {10, 10, 10}, .spacing_mm = glm::dvec3(1)};
  Mask mask(geometry);
  LumenFill fill(geometry);
  add_lumen_of_lines({{{{-20, 5, 5}, 2}, {{30, 5, 5}, 2}}, {{{50, 50, 50}, 2}, {{60, 60, 60}, 2}}}, mask,
                     fill);
  // Thirteen voxels' centres lie within a circle of two voxels, and its border runs through four of them.
  EXPECT_NEAR(static_cast<double>(mask.count()), 130, 10 * 4);
}

}  // namespace
}  // namespace xraycast::longer_ends_test
