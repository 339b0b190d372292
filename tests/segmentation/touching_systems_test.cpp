// Two systems of vessels of one brightness that touch are parted by a point in each: trees by a seed, moved
// until their walls meet.
#include "xraycast/mask/touching_systems.hpp"

#include "support/branching_tree.hpp"
#include "support/shared_device.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/segmentation/segment.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace xraycast::touching_systems_test {
namespace {

VesselTree moved(const VesselTree& tree, const glm::dvec3& by_mm) {
  std::vector<VesselBranch> branches = tree.branches();
  for (VesselBranch& branch : branches)
    for (VesselPoint& point : branch.points) point.position_mm += by_mm;
  return {std::move(branches), "moved"};
}

/// Between the walls of two trees; negative where they overlap.
double gap_mm(const VesselTree& a, const VesselTree& b) {
  double least_mm = std::numeric_limits<double>::infinity();
  for (const VesselBranch& one : a.branches())
    for (const VesselBranch& other : b.branches())
      for (const VesselPoint& p : one.points)
        for (const VesselPoint& q : other.points)
          least_mm =
              std::min(least_mm, glm::distance(p.position_mm, q.position_mm) - p.radius_mm - q.radius_mm);
  return least_mm;
}

/// Two trees that overlap by a part of a millimetre where they touch first, on the grid of both.
struct Systems {
  VesselTree own, other;
  VolumeGeometry grid;
};

Systems touching(std::uint32_t seed, double voxel_mm) {
  constexpr double kOverlap_mm = 0.2, kMargin_mm = 12;
  const VesselTree own = branching_tree(seed);
  const double around = 2 * std::numbers::pi * static_cast<double>(seed % 17) / 17;
  const glm::dvec3 out(std::cos(around), std::sin(around), 0);
  const VesselTree other = branching_tree(seed + 1000);
  const glm::dvec3 together =
      own.branches()[0].points[0].position_mm - other.branches()[0].points[0].position_mm;
  double near_mm = 0, far_mm = 300;
  while (far_mm - near_mm > 0.05) {
    const double mm = 0.5 * (near_mm + far_mm);
    (gap_mm(own, moved(other, together + mm * out)) < -kOverlap_mm ? near_mm : far_mm) = mm;
  }
  Systems systems{own, moved(other, together + far_mm * out), {}};
  glm::dvec3 low_mm(1e9), high_mm(-1e9);
  for (const VesselTree* tree : {&systems.own, &systems.other})
    for (const VesselBranch& branch : tree->branches())
      for (const VesselPoint& point : branch.points) {
        low_mm = glm::min(low_mm, point.position_mm - point.radius_mm - kMargin_mm);
        high_mm = glm::max(high_mm, point.position_mm + point.radius_mm + kMargin_mm);
      }
  systems.grid = {Index3((high_mm - low_mm) / voxel_mm), glm::dvec3(voxel_mm), low_mm};
  return systems;
}

Mask lumen_of(const VesselTree& tree, const VolumeGeometry& grid) {
  Mask mask(grid);
  for_each_voxel({{0, 0, 0}, grid.size}, [&](const Index3& voxel) {
    mask[voxel] = tree.inside(grid.to_world_mm(glm::dvec3(voxel))) ? 1 : 0;
  });
  return mask;
}

/// Of a tree's trunk.
glm::dvec3 middle_mm(const VesselTree& tree) {
  const auto& trunk = tree.branches()[static_cast<std::size_t>(tree.root())].points;
  return trunk[trunk.size() / 2].position_mm;
}

std::int64_t common(Mask a, const Mask& b) {
  intersect(a, b);
  return a.count();
}

double dice(const Mask& a, const Mask& b) {
  return 2 * static_cast<double>(common(a, b)) / static_cast<double>(a.count() + b.count());
}

class TouchingSystems : public testing::TestWithParam<std::uint32_t> {};

TEST_P(TouchingSystems, OfAMaskArePartedAtTheNeckBetweenThem) {
  const Systems systems = touching(GetParam(), 0.5);
  const Mask own = lumen_of(systems.own, systems.grid), other = lumen_of(systems.other, systems.grid);
  Mask both = own;
  unite(both, other);
  const auto voxel = [&](const VesselTree& tree) {
    return Index3(glm::round(systems.grid.to_index(middle_mm(tree))));
  };
  const Mask taken = touching_system(both, {voxel(systems.own)}, {voxel(systems.other)}, 17);
  EXPECT_GE(dice(taken, other), 0.99);  // but for the voxels where they touch
}

/// A scan of two systems of one brightness in soft tissue, blurred over a voxel, with noise of 8 HU and air
/// on both sides.
Volume scan_of(const Mask& lumen, std::uint32_t seed) {
  const VolumeGeometry& grid = lumen.geometry;
  constexpr std::int64_t kAir = 6;
  const auto sharp_hu = [&](const Index3& v) {
    const bool is_air = std::min({v.x, v.y, grid.size.x - 1 - v.x, grid.size.y - 1 - v.y}) < kAir;
    return is_air ? -1000.0 : lumen.at(v) ? 300.0 : 50.0;
  };
  std::mt19937 random(seed);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  Volume scan(grid);
  for (std::size_t i = 0; i < scan.hu().size(); ++i) {
    const Index3 here = voxel_at(grid, static_cast<std::int64_t>(i));
    double sum = 8 * sharp_hu(here);
    for (std::size_t k = 0; k < kNeighbours.size(); ++k)
      sum += (k < 6 ? 4 : k < 18 ? 2 : 1) * sharp_hu(here + kNeighbours[k]);
    scan.hu()[i] = static_cast<std::int16_t>(std::lround(sum / 64 + 20 * (uniform() + uniform() - 1)));
  }
  return scan;
}

TEST_P(TouchingSystems, OfAScanArePartedByASeedAndAPointToExclude) {
  const Systems systems = touching(GetParam(), 0.7);
  const Mask own = lumen_of(systems.own, systems.grid), other = lumen_of(systems.other, systems.grid);
  Mask both = own;
  unite(both, other);
  const Volume scan = scan_of(both, GetParam());
  const auto found = [&](const VesselTree& wanted, const VesselTree& excluded) {
    SegmentRequest request;
    request.markers.vessels_mm = {middle_mm(wanted)};
    request.markers.not_vessels_mm = {middle_mm(excluded)};
    Progress unheard;
    return segment_vessels(scan, request, "scan", test::device(), unheard).mask;
  };
  const Mask of_own = found(systems.own, systems.other), of_other = found(systems.other, systems.own);
  // 0.958 to 0.994 when this was written; without parting 0.4 to 0.7.
  EXPECT_GE(dice(of_own, own), 0.93);
  EXPECT_GE(dice(of_other, other), 0.93);
  // The voxels between them hold some of both.
  EXPECT_LE(common(of_own, other), other.count() / 100);
  EXPECT_LE(common(of_other, own), own.count() / 100);
}

INSTANTIATE_TEST_SUITE_P(BySeed, TouchingSystems, testing::Range(0U, 6U));

}  // namespace
}  // namespace xraycast::touching_systems_test
