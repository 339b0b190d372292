// Tubes whose centreline and radius are known in closed form.
#include "xraycast/segmentation/centreline.hpp"

#include "support/tubes.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/segmentation/poor_results.hpp"
#include "xraycast/skeleton/skeleton_pruning.hpp"

#include <glm/trigonometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <tuple>
#include <vector>

namespace xraycast::centreline_test {
namespace {

struct Deviation {
  double off_vox = 0;       ///< largest distance of a point from the true centreline
  double radius_share = 0;  ///< of the mean radius from the true one
};

/// Of all points for which `counts`, against the distance from the true line.
template <typename Counts, typename Distance>
Deviation deviation(const VesselTree& tree, double radius_mm, const Counts& counts,
                    const Distance& distance) {
  Deviation worst;
  double sum = 0;
  int points = 0;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      if (!counts(point.position_mm)) continue;
      worst.off_vox = std::max(worst.off_vox, distance(point.position_mm));
      worst.radius_share = std::max(worst.radius_share, std::abs(point.radius_mm / radius_mm - 1));
      sum += point.radius_mm;
      ++points;
    }
  EXPECT_GT(points, 20);
  EXPECT_NEAR(sum / points, radius_mm, 0.03 * radius_mm);
  return worst;
}

class Straight : public testing::TestWithParam<double> {};

TEST_P(Straight, TubeIsFoundBetweenVoxels) {
  const double radius = GetParam();
  const glm::dvec3 a(14.3, 15.6, 12.2), b(50.1, 38.4, 70.7);
  const Mask tube = mask_where({.size = {66, 56, 84}},
                               [&](const glm::dvec3& p) { return distance_to_segment(p, a, b) < radius; });
  const Centrelines found = extract_centrelines(tube, "tube");
  ASSERT_EQ(found.tree.branches().size(), 1U);
  const Deviation worst = deviation(
      found.tree, radius, [](const auto&) { return true; },
      [&](const glm::dvec3& p) { return distance_to_segment(p, a - (b - a), b + (b - a)); });
  EXPECT_LT(worst.off_vox, 0.3) << "radius " << radius;
  // The ends are known to about a voxel each: that is where the last sphere touches the round cap.
  EXPECT_NEAR(found.tree.branches()[0].arc_length_mm.back(), glm::distance(a, b), 2);
}

INSTANTIATE_TEST_SUITE_P(OfRadius, Straight, testing::Values(2.0, 3.3, 5.0, 7.5));

TEST(Centrelines, EndWithALineOfSingleVoxels) {
  const Mask line = mask_where({.size = {60, 20, 20}}, [](const glm::dvec3& p) {
    return p.x >= 10 && p.x <= 40 && p.y == 10 && p.z == 10;
  });
  const Centrelines found = extract_centrelines(line, "line");
  ASSERT_EQ(found.tree.branches().size(), 1U);
  // Its wall lies half a voxel beyond the last voxel's centre.
  EXPECT_NEAR(found.tree.branches()[0].arc_length_mm.back(), 30, 1);
}

/// A vessel that narrows downwards, with an aneurysm at its side, wider than it.
Mask vessel_with_aneurysm() {
  return mask_where({.size = {60, 40, 100}}, [](const glm::dvec3& p) {
    const double radius = 3 + 0.02 * p.z;
    return (p.z >= 8 && p.z <= 92 && std::hypot(p.x - 20, p.y - 20) < radius) ||
           glm::distance(p, {33, 20, 50}) < 9;
  });
}

TEST(Centrelines, BeginAtTheWidestVesselAndNotInAnAneurysm) {
  const VesselTree tree = extract_centrelines(vessel_with_aneurysm(), "vessel").tree;
  ASSERT_EQ(tree.branches().size(), 3U);
  EXPECT_NEAR(tree.branches()[0].points.front().position_mm.z, 92, 6);
}

TEST(Centrelines, BeginAtTheEndNearestToTheRoot) {
  Progress unheard;
  const VesselTree tree =
      extract_centrelines(vessel_with_aneurysm(), "vessel", unheard, glm::dvec3(20, 20, 0)).tree;
  EXPECT_NEAR(tree.branches()[0].points.front().position_mm.z, 8, 6);
}

TEST(Centrelines, FollowABentTube) {
  const glm::dvec3 centre(10, 10, 20);
  constexpr double kBend = 40, kRadius = 4.5;
  const auto distance = [&](const glm::dvec3& p) {
    const glm::dvec3 d = p - centre;
    return std::hypot(std::hypot(d.x, d.y) - kBend, d.z);
  };
  const Mask tube = mask_where({.size = {62, 62, 40}}, [&](const glm::dvec3& p) {
    return distance(p) < kRadius && p.x > 12 && p.y > 12;
  });
  const Centrelines found = extract_centrelines(tube, "tube");
  ASSERT_EQ(found.tree.branches().size(), 1U);
  // Within a radius of the cut faces the cross-section is no longer the tube's.
  const auto counts = [&](const glm::dvec3& p) { return p.x > 12 + kRadius && p.y > 12 + kRadius; };
  const Deviation worst = deviation(found.tree, kRadius, counts, distance);
  EXPECT_LT(worst.off_vox, 0.3);
}

TEST(Centrelines, PartWhereATubeBranches) {
  const glm::dvec3 root(40, 20, 8), fork(40, 20, 40), left(14, 20, 78), right(66, 26, 78);
  constexpr double kRadius = 4;
  const auto distance = [&](const glm::dvec3& p) {
    return std::min({distance_to_segment(p, root, fork), distance_to_segment(p, fork, left),
                     distance_to_segment(p, fork, right)});
  };
  const Mask tube =
      mask_where({.size = {80, 44, 90}}, [&](const glm::dvec3& p) { return distance(p) < kRadius; });
  const Centrelines found = extract_centrelines(tube, "tube");
  ASSERT_EQ(found.tree.branches().size(), 3U);
  EXPECT_EQ(found.tree.branches()[static_cast<std::size_t>(found.tree.root())].children.size(), 2U);
  EXPECT_THAT(found.loops, testing::IsEmpty());
  // Around the fork the cross-section is that of two tubes together, up to where they have parted: twice the
  // radius over the angle between them.
  const auto counts = [&](const glm::dvec3& p) { return glm::distance(p, fork) > 3 * kRadius; };
  const Deviation worst = deviation(found.tree, kRadius, counts, distance);
  EXPECT_LT(worst.off_vox, 0.3);
}

/// A tube 20 voxels wide whose wall noise has pitted.
Mask pitted_tube(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  Mask tube = mask_where({.size = {40, 40, 100}}, [](const glm::dvec3& p) {
    return p.z >= 8 && p.z <= 92 && std::hypot(p.x - 20, p.y - 20) < 10;
  });
  for (int pit = 0; pit < 80; ++pit) {
    const double angle = uniform(0, 2 * std::acos(-1)), out = uniform(7, 10), radius = uniform(0.6, 1.8);
    const glm::dvec3 middle(20 + out * std::cos(angle), 20 + out * std::sin(angle), uniform(15, 85));
    for_each_voxel({Index3(0), tube.geometry.size}, [&](const Index3& v) {
      if (glm::distance(glm::dvec3(v), middle) < radius) tube[v] = 0;
    });
  }
  return tube;
}

TEST(Centrelines, OfAWideVesselAreHardlyEverPartedByPitsInItsWall) {
  // By the inscribed spheres alone, half of such tubes have three branches and more.
  int parted = 0;
  for (std::uint32_t seed = 1; seed <= 8; ++seed)
    parted += extract_centrelines(pitted_tube(seed), "tube").tree.branches().size() > 1;
  EXPECT_LE(parted, 1);
}

TEST(Centrelines, OfASmallBranchOnAWideVesselStay) {
  // It reaches four voxels out of the wall.
  const Mask vessel = mask_where({.size = {50, 40, 100}}, [](const glm::dvec3& p) {
    return (p.z >= 8 && p.z <= 92 && std::hypot(p.x - 20, p.y - 20) < 10) ||
           (p.x >= 20 && p.x < 36 && std::hypot(p.y - 20, p.z - 50) < 1.8);
  });
  EXPECT_EQ(extract_centrelines(vessel, "vessel").tree.branches().size(), 3U);
}

TEST(Centrelines, OfAWideVesselPassItsBranchesStraight) {
  const glm::dvec3 axis(30.3, 30.7, 0);
  const Mask vessel = mask_where({.size = {80, 60, 150}}, [&](const glm::dvec3& p) {
    const bool is_trunk = p.z >= 8 && p.z <= 142 && std::hypot(p.x - axis.x, p.y - axis.y) < 10;
    const auto is_branch = [&](double z, double towards) {
      const double along = (p.x - axis.x) * towards;
      return along > 0 && along < 28 && std::hypot(p.y - axis.y, p.z - z - 0.4 * along) < 3;
    };
    return is_trunk || is_branch(50, 1) || is_branch(62, -1) || is_branch(100, 1);
  });
  const VesselTree tree = extract_centrelines(vessel, "vessel").tree;
  ASSERT_EQ(tree.branches().size(), 7U);
  double off_vox = 0;
  int trunks = 0;
  for (const VesselBranch& branch : tree.branches()) {
    if (branch.points[branch.points.size() / 2].radius_mm < 8) continue;
    ++trunks;
    for (const VesselPoint& point : branch.points)
      off_vox = std::max(off_vox, glm::distance(glm::dvec2(point.position_mm), glm::dvec2(axis)));
  }
  EXPECT_EQ(trunks, 4);
  // Thinned lines bend by 2 voxels towards each branch; where it opens, the middle of the lumen does by a
  // little.
  EXPECT_LT(off_vox, 0.7);
}

TEST(Centrelines, ReachTheScansSideWhereAVesselLeavesIt) {
  // An arc about the y axis' direction that leaves the grid at its last slice, obliquely.
  constexpr double kArc = 60, kRadius = 8;
  const auto off = [&](const glm::dvec3& p) {
    return std::hypot(std::hypot(p.x - 5, p.z - 5) - kArc, p.y - 20);
  };
  const Mask tube = mask_where({.size = {90, 40, 50}},
                               [&](const glm::dvec3& p) { return p.x > 5 && p.z > 14 && off(p) < kRadius; });
  const VesselTree tree = extract_centrelines(tube, "tube").tree;
  ASSERT_EQ(tree.branches().size(), 1U);
  const auto& points = tree.branches()[0].points;
  const VesselPoint& end =
      points.front().position_mm.z > points.back().position_mm.z ? points.front() : points.back();
  EXPECT_GT(end.position_mm.z, 49 - 2 * 0.75);  // within two steps of the last slice
  // The side cuts it obliquely: its last cross-sections are not whole, and their middles are elsewhere.
  EXPECT_LT(off(end.position_mm), 0.4 * kRadius);
}

TEST(Centrelines, OfALumenWithAFoldKeepItsRadius) {
  constexpr double kRadius = 10;
  const Mask aorta = mask_where({.size = {50, 50, 120}}, [&](const glm::dvec3& p) {
    const double x = p.x - 25, y = p.y - 25;
    const bool is_fold = std::abs(p.z - 60) < 8 && std::abs(x) < 1 && y < 4;
    return std::hypot(x, y) < kRadius && p.z > 8 && p.z < 112 && !is_fold;
  });
  const VesselTree tree = extract_centrelines(aorta, "aorta").tree;
  int points = 0;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      if (std::abs(point.position_mm.z - 60) > 6) continue;
      ++points;
      // Beside a fold up to its middle, half of the rays end at the fold.
      EXPECT_GT(point.radius_mm, 0.6 * kRadius) << point.position_mm.z;
    }
  EXPECT_GT(points, 10);
}

TEST(Centrelines, OfAWideVesselKeepABulgeWhereABranchLeaves) {
  const Mask vessel = mask_where({.size = {80, 60, 150}}, [](const glm::dvec3& p) {
    const double bulge = 6 * std::exp(-0.5 * (p.z - 70) * (p.z - 70) / 64);
    return (p.z >= 8 && p.z <= 142 && std::hypot(p.x - 30, p.y - 30) < 8 + bulge) ||
           (p.x > 30 && p.x < 66 && std::hypot(p.y - 30, p.z - 70) < 2.5);
  });
  const VesselTree tree = extract_centrelines(vessel, "vessel").tree;
  ASSERT_EQ(tree.branches().size(), 3U);
  double widest = 0;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) widest = std::max(widest, point.radius_mm);
  // 14 voxels, but for smoothing along the line over some three.
  EXPECT_NEAR(widest, 14, 1.5);
}

/// The centrelines of straight branches side by side.
Centrelines comb(int branches, int loops) {
  std::vector<VesselBranch> all{{{{{0, 0, 0}, 1}, {{0, 0, 9}, 1}}, -1, {}, {}}};
  while (static_cast<int>(all.size()) < branches) {
    const auto x = static_cast<double>(all.size());
    all.push_back({{{{0, 0, 9}, 1}, {{x, 0, 20}, 1}}, 0, {}, {}});
  }
  return {VesselTree(std::move(all), "comb"), std::vector<int>(static_cast<std::size_t>(loops), 1), {}, 0};
}

TEST(Centrelines, OfARingEndWhereItIsCutAndNotInASpur) {
  const glm::dvec3 middle(30, 30, 8);
  const auto at = [&](double degrees, double out = 20) {
    return middle + out * glm::dvec3(std::cos(glm::radians(degrees)), std::sin(glm::radians(degrees)), 0);
  };
  const Mask mask = mask_where({.size = {60, 60, 16}}, [&](const glm::dvec3& p) {
    return std::hypot(glm::length(glm::dvec2(p - middle)) - 20, p.z - 8) < 3 ||
           distance_to_segment(p, at(0), at(0, 28)) < 3;
  });
  const MaskLumen lumen(mask);
  // A way in at 0 degrees, and a spur of two voxels at each of two other places.
  SkeletonGraph graph;
  const auto add = [&](int from, int to, std::vector<glm::dvec3> points_mm) {
    for (const int n : {from, to})
      graph.nodes[static_cast<std::size_t>(n)].edges.push_back(static_cast<int>(graph.edges.size()));
    graph.edges.push_back({{from, to}, std::move(points_mm)});
  };
  for (const glm::dvec3& p : {at(0), at(0, 28), at(100), at(100, 22), at(230), at(230, 18)})
    graph.nodes.push_back({p, {}});
  const auto arc = [&](double from, double to) {
    std::vector<glm::dvec3> points_mm;
    const double step = from < to ? 2 : -2;
    for (int k = 0; k <= std::abs(to - from) / 2; ++k) points_mm.push_back(at(from + k * step));
    return points_mm;
  };
  add(1, 0, {at(0, 28), at(0, 24), at(0)});
  add(0, 2, arc(0, 100));
  add(4, 2, arc(230, 100));
  add(0, 4, arc(360, 230));  // wherever it is cut, at a second node, there is a spur
  add(2, 3, {at(100), at(100, 21), at(100, 22)});
  add(4, 5, {at(230), at(230, 19), at(230, 18)});
  const SkeletonGraph pruned = prune(std::move(graph), lumen, 2);
  ASSERT_EQ(pruned.edges.size(), 1U);  // the way in, and the ring that goes on from it
  EXPECT_TRUE(pruned.edges[0].closes_loop);
  for (const glm::dvec3& p : pruned.edges[0].points_mm)
    if (glm::distance(p, at(0)) > 9) {
      EXPECT_NEAR(glm::distance(p, middle), 20, 1e-6);
    }
}

/// A wide vessel goes on beyond both sides of the scan. Noise has pitted its wall, and thinning leads its
/// line into the corners between pits.
TEST(Centrelines, OfAPittedVesselReachTheScansSides) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution(low, high)(random);
    };
    const double radius = uniform(7, 11);
    struct Pit {
      glm::dvec3 middle;
      double radius;
    };
    std::vector<Pit> pits;  // at both ends
    for (int k = 0; k < 16; ++k) {
      const double angle = uniform(0, 6.28), z = uniform(6, 22), from = radius + uniform(-1, 0.5);
      pits.push_back({{20 + from * std::cos(angle), 20 + from * std::sin(angle), k % 2 == 0 ? z : 69 - z},
                      uniform(2, 3.5)});
    }
    const Mask vessel = mask_where({.size = {40, 40, 70}}, [&](const glm::dvec3& p) {
      return glm::length(glm::dvec2(p) - 20.0) < radius && std::ranges::none_of(pits, [&](const Pit& pit) {
               return glm::distance(p, pit.middle) < pit.radius;
             });
    });
    const VesselTree tree = extract_centrelines(vessel, "vessel").tree;
    ASSERT_EQ(tree.branches().size(), 1U) << seed;
    const auto& points = tree.branches()[0].points;
    const auto [low, high] = std::minmax(points.front().position_mm.z, points.back().position_mm.z);
    // To the outermost voxels' middles, but for a step of the line.
    EXPECT_LT(low, 1) << seed;
    EXPECT_GT(high, 68) << seed;
  }
}

/// A wide vessel forks a little above the scan's side, and its branches are half as wide.
TEST(Centrelines, OfAForkBesideTheScansSideReachIt) {
  for (const auto& [radius, slope, above] : {std::tuple{5.0, 0.45, 16.0}, std::tuple{5.0, 0.8, 14.0},
                                             std::tuple{4.0, 0.45, 16.0}, std::tuple{4.0, 0.45, 22.0}}) {
    const glm::dvec3 fork(40, 20, above);
    const auto below = [&](double side) { return fork + 1.5 * above * glm::dvec3(side * slope, 0, -1); };
    const Mask vessel = mask_where({.size = {80, 40, 70}}, [&](const glm::dvec3& p) {
      return distance_to_segment(p, fork, {40, 20, 100}) < 9 ||
             distance_to_segment(p, fork, below(1)) < radius ||
             distance_to_segment(p, fork, below(-1)) < radius;
    });
    const VesselTree tree = extract_centrelines(vessel, "fork").tree;
    ASSERT_EQ(tree.branches().size(), 3U) << radius << " " << slope << " " << above;
    for (const VesselBranch& branch : tree.branches())
      if (branch.children.empty()) {
        // A step of the line.
        EXPECT_LT(branch.points.back().position_mm.z, 1) << radius << " " << slope << " " << above;
      }
  }
}

TEST(PoorResults, SayWhereARootLiesBesideEachEnd) {
  const VesselTree tree = comb(3, 0).tree;
  const VesselPoint& begin = tree.branches()[static_cast<std::size_t>(tree.root())].points.front();
  const auto beside = [&](double mm) { return begin.position_mm + glm::dvec3(0, 0, begin.radius_mm + mm); };
  EXPECT_THAT(far_root(tree, std::nullopt, "scan"), testing::IsEmpty());
  EXPECT_THAT(far_root(tree, beside(9.9), "scan"), testing::IsEmpty());
  EXPECT_THAT(far_root(tree, beside(10.1), "scan"),
              testing::ElementsAre(testing::HasSubstr("mm from the nearest end")));
}

TEST(PoorResults, NameTheFieldThatHelps) {
  const VolumeGeometry fine{.size = {9, 9, 9}}, coarse{.size = {9, 9, 9}, .spacing_mm = {1, 1, 3}};
  EXPECT_THAT(poor_results(comb(1, 0), fine, "scan"), testing::IsEmpty());
  EXPECT_THAT(poor_results(comb(40, 5), coarse, "scan"), testing::IsEmpty());
  EXPECT_THAT(poor_results(comb(1, 0), coarse, "scan"),
              testing::ElementsAre(testing::HasSubstr("voxels of 3 mm show no thin vessels")));
  EXPECT_THAT(poor_results(comb(201, 0), fine, "scan"),
              testing::ElementsAre(testing::HasSubstr("found 201 branches and 0 loops")));
  EXPECT_THAT(poor_results(comb(30, 6), fine, "scan"),
              testing::ElementsAre(testing::HasSubstr("give `window_hu`, `seeds`, or `not_vessels`")));
}

TEST(PoorResults, OfNoHintAreSaidWhereTheyAreLittle) {
  const VolumeGeometry small{.size = {9, 9, 20}}, large{.size = {90, 90, 90}};
  EXPECT_THAT(too_little(comb(1, 0).tree, small, "scan"), testing::IsEmpty());
  EXPECT_THAT(too_little(comb(1, 0).tree, large, "scan"),
              testing::ElementsAre(testing::HasSubstr("found 9 mm of vessels in all")));
}

TEST(Centrelines, OfAnisotropicVoxelsAreInMillimetres) {
  const glm::dvec3 a(-20, 5, -30), b(12, 8, 31);
  constexpr double kRadius = 4;
  const VolumeGeometry grid{.size = {80, 40, 40}, .spacing_mm = {0.7, 0.7, 2}, .origin_mm = {-30, -8, -39}};
  const Mask tube =
      mask_where(grid, [&](const glm::dvec3& p) { return distance_to_segment(p, a, b) < kRadius; });
  const Centrelines found = extract_centrelines(tube, "tube");
  ASSERT_EQ(found.tree.branches().size(), 1U);
  const Deviation worst = deviation(
      found.tree, kRadius, [](const auto&) { return true; },
      [&](const glm::dvec3& p) { return distance_to_segment(p, a, b); });
  EXPECT_LT(worst.off_vox, 0.3 * 2);
}

TEST(Centrelines, CutARingOpenAndSaySo) {
  const Mask ring = mask_where({.size = {60, 60, 16}}, [&](const glm::dvec3& p) {
    const double r = glm::length(glm::dvec2(p) - 30.0);
    return std::hypot(r - 20, p.z - 8) < 3 || distance_to_segment(p, {2, 30, 8}, {12, 30, 8}) < 3 ||
           distance_to_segment(p, {48, 30, 8}, {58, 30, 8}) < 3;
  });
  const Centrelines found = extract_centrelines(ring, "ring");
  // The way in, half of the ring with the way out, and the other half.
  EXPECT_EQ(found.tree.branches().size(), 3U);
  EXPECT_EQ(found.loops.size(), 1U);
}

TEST(Centrelines, JoinPartsAndSayHow) {
  const Mask parts = mask_where({.size = {20, 20, 70}}, [](const glm::dvec3& p) {
    return glm::length(glm::dvec2(p) - 10.0) < 3 && (p.z < 30 || p.z > 36);
  });
  const Centrelines found = extract_centrelines(parts, "parts");
  ASSERT_EQ(found.gaps_mm.size(), 1U);
  // Six empty slices, and what thinning takes off an end: up to its radius on each side.
  EXPECT_GE(found.gaps_mm[0], 7);
  EXPECT_LE(found.gaps_mm[0], 7 + 2 * 3);
  EXPECT_EQ(found.tree.branches().size(), 1U);
}

TEST(Centrelines, JoinVesselsBeyondTheScanThatLeaveItSideBySide) {
  // Two arteries of a neck: nearest to each other at the top, but both go on below.
  const Mask parts = mask_where({.size = {60, 20, 70}}, [](const glm::dvec3& p) {
    return p.z < 60 && (distance_to_segment(p, {12, 10, -9}, {26, 10, 60}) < 3 ||
                        distance_to_segment(p, {48, 10, -9}, {34, 10, 60}) < 3);
  });
  const Centrelines found = extract_centrelines(parts, "parts");
  ASSERT_EQ(found.gaps_mm.size(), 1U);
  // At z = 0 they are 32 apart, and less by up to two where thinning leaves their ends; at the top only 8.
  EXPECT_NEAR(found.gaps_mm[0], 32, 2);
  // Two arteries and what joins them.
  EXPECT_EQ(found.tree.branches().size(), 3U);
}

TEST(Centrelines, JoinEndsRatherThanSides) {
  // An artery that was interrupted passes by another one, to which it is nearer than to its own other half.
  const Mask parts = mask_where({.size = {60, 60, 30}}, [](const glm::dvec3& p) {
    const auto tube = [&](const glm::dvec3& a, const glm::dvec3& b) {
      return distance_to_segment(p, a, b) < 2.5;
    };
    return tube({30, 8, 6}, {30, 52, 6}) || tube({4, 30, 24}, {24, 30, 17}) ||
           tube({42, 30, 17}, {56, 30, 24});
  });
  const Centrelines found = extract_centrelines(parts, "parts");
  ASSERT_EQ(found.gaps_mm.size(), 2U);
  // The two halves are one branch, whose ends lie far apart.
  const auto spans = [](const VesselBranch& branch) {
    return std::abs(branch.points.back().position_mm.x - branch.points.front().position_mm.x);
  };
  EXPECT_GT(std::ranges::max(found.gaps_mm), 18);
  EXPECT_EQ(std::ranges::count_if(found.tree.branches(), [&](const auto& b) { return spans(b) < 4; }), 2);
}

TEST(Centrelines, LeaveOutWhatIsFartherAwayThanAnythingIsLong) {
  const Mask parts = mask_where({.size = {70, 20, 50}}, [](const glm::dvec3& p) {
    const auto tube = [&](double x, double from, double to) {
      return distance_to_segment(p, {x, 10, from}, {x, 10, to}) < 3;
    };
    return tube(6, 8, 42) || tube(62, 12, 38);  // 50 apart, 40 and 32 long
  });
  const Centrelines found = extract_centrelines(parts, "parts");
  EXPECT_EQ(found.parts_left_out, 1);
  EXPECT_THAT(found.gaps_mm, testing::IsEmpty());
  ASSERT_EQ(found.tree.branches().size(), 1U);
  EXPECT_NEAR(found.tree.branches()[0].points.front().position_mm.x, 6, 0.5);  // half a voxel
}

TEST(Centrelines, PassOverAHoleInTheLumen) {
  Mask tube = mask_where({.size = {30, 30, 60}}, [](const glm::dvec3& p) {
    return distance_to_segment(p, {15, 15, 8}, {15, 15, 52}) < 4.5;
  });
  for (std::int64_t x = 0; x < 30; ++x)  // noise made a tunnel across it
    for (std::int64_t z = 28; z < 31; ++z) tube[{x, 15, z}] = 0;
  const Centrelines found = extract_centrelines(tube, "tube");
  EXPECT_EQ(found.tree.branches().size(), 1U);
  EXPECT_THAT(found.loops, testing::IsEmpty());
}

/// A tube 5 voxels wide, whose last quarter noise has perforated.
Mask perforated_tube(std::uint32_t seed) {
  constexpr double kHoles = 0.2;
  std::mt19937 random(seed);
  Mask tube = mask_where({.size = {44, 36, 64}}, [](const glm::dvec3& p) {
    return distance_to_segment(p, {14, 15, 12}, {30, 20, 50}) < 2.6;
  });
  for_each_voxel({{0, 0, 40}, tube.geometry.size}, [&](const Index3& v) {
    if (static_cast<double>(random()) < kHoles * 4294967296.0) tube[v] = 0;
  });
  return tube;
}

TEST(Centrelines, OfAPerforatedVesselAreSeldomPartedByHoles) {
  // By the circumference of the spheres that fit in between its holes, half of such tubes have loops.
  constexpr int kTubes = 30;
  int parted = 0, looped = 0;
  for (std::uint32_t seed = 1; seed <= kTubes; ++seed) {
    const Centrelines found = extract_centrelines(perforated_tube(seed), "tube");
    parted += found.tree.branches().size() > 1;
    looped += !found.loops.empty();
  }
  EXPECT_LE(parted, kTubes / 10);
  EXPECT_LE(looped, kTubes / 4);
}

TEST(Centrelines, RefuseWhatHasNoLength) {
  EXPECT_THROW(extract_centrelines(Mask({.size = {9, 9, 9}}), "nothing"), InputError);
  Mask point({.size = {9, 9, 9}});
  point[{4, 4, 4}] = 1;
  EXPECT_THROW(extract_centrelines(point, "point"), InputError);
}

}  // namespace
}  // namespace xraycast::centreline_test
