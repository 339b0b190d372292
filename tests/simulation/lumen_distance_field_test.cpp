#include "xraycast/catheter/lumen_distance_field.hpp"

#include "xraycast/phantom/phantom.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace xraycast::lumen_distance_field_test {
namespace {

using Eigen::Vector3d;

glm::dvec3 to_glm(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Vector3d to_eigen(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

VesselTree phantom_tree(const std::string& name) { return {make_phantom(name).vessel_branches(), name}; }

/// A trunk up the z axis that parts into two, 30 degrees to either side.
VesselTree fork() {
  std::vector<VesselBranch> branches(3);
  for (int i = 0; i <= 60; ++i) branches[0].points.push_back({{0, 0, i - 60.0}, 5});
  for (const int side : {-1, 1})
    for (int i = 0; i <= 60; ++i)
      branches[side < 0 ? 1 : 2].points.push_back({{side * 0.5 * i, 0, 0.866 * i}, 5 - i / 40.0});
  branches[1].parent = branches[2].parent = 0;
  return {branches, "fork"};
}

/// Random points in and just outside of the lumen, each where it is looked for.
template <typename Check>
void for_points_around(const VesselTree& tree, const Check& check) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    const auto& branch = tree.branches()[random() % tree.branches().size()];
    const VesselPoint& point = branch.points[random() % branch.points.size()];
    const Vector3d direction = Vector3d(normal(random), normal(random), normal(random)).normalized();
    check(to_eigen(point.position_mm) + 1.2 * unit(random) * point.radius_mm * direction);
  }
}

TEST(LumenDistanceField, AgreesWithTheTreeOnInsideAndOutside) {
  for (const char* name : {"thorax", "head"}) {
    const VesselTree tree = phantom_tree(name);
    const LumenDistanceField field(tree);
    int points = 0, odd = 0;
    for_points_around(tree, [&](const Vector3d& point) {
      const double clearance = field.at(point, field.locate(point)).clearance_mm;
      // A wall is blended by an eighth of half a millimetre where two vessels meet; stations are up to 1.5 mm
      // apart, along bends of some 10 mm.
      if (std::abs(clearance) < 0.25) return;
      ++points;
      if ((clearance > 0) != tree.inside(to_glm(point))) ++odd;
    });
    EXPECT_GT(points, 10000) << name;
    // At an aneurysm's neck the radius grows faster than the way: there a sphere reaches beyond its
    // cross-section.
    EXPECT_LE(odd, points / 5000) << name;
  }
}

TEST(LumenDistanceField, GradientAndCurvatureAreLimitsOfDifferences) {
  const VesselTree tree = fork();
  const LumenDistanceField field(tree);
  constexpr double kStep_mm = 1e-5;
  int kinks = 0, jumps = 0, points = 0;
  for_points_around(tree, [&](const Vector3d& point) {
    const LumenDistanceField::SearchHint hint = field.locate(point);
    const LumenDistanceField::Sample sample = field.at(point, hint);
    if (sample.clearance_mm < -2 || sample.clearance_mm > 2) return;
    Vector3d slope;
    Eigen::Matrix3d curvature;
    for (int c = 0; c < 3; ++c) {
      Vector3d step = Vector3d::Zero();
      step[c] = kStep_mm;
      const LumenDistanceField::Sample ahead = field.at(point + step, hint),
                                       behind = field.at(point - step, hint);
      slope[c] = (ahead.clearance_mm - behind.clearance_mm) / (2 * kStep_mm);
      curvature.col(c) = (behind.gradient - ahead.gradient) / (2 * kStep_mm);
    }
    ++points;
    // The sphere that reaches furthest is found to 1e-5 of a piece, which the difference divides by its step.
    if ((slope - sample.gradient).norm() > 1e-2) ++kinks;
    // Where a branch begins to be blended the second derivative jumps.
    if ((curvature - sample.curvature()).norm() > 0.02 * (1 + curvature.norm())) ++jumps;
  });
  EXPECT_GT(points, 5000);
  // Where two places of one branch are equally near, the difference may look across a kink.
  EXPECT_LT(kinks, points / 1000);
  EXPECT_LT(jumps, points / 1000);
}

TEST(LumenDistanceField, ManyPointsAreSampledAsEachAlone) {
  for (const VesselTree& tree : {fork(), phantom_tree("thorax"), phantom_tree("head")}) {
    const LumenDistanceField field(tree);
    // Points of all kinds side by side: on pieces, beyond ends, where vessels meet and in bends. Not a
    // multiple of what is worked on at once.
    std::vector<Vector3d> points;
    for_points_around(tree, [&](const Vector3d& point) {
      if (points.size() < 1001) points.push_back(point);
    });
    std::vector<LumenDistanceField::Sample> samples(points.size());
    std::vector<LumenDistanceField::Query> queries;
    for (std::size_t k = 0; k < points.size(); ++k)
      queries.push_back({points[k], field.locate(points[k]), &samples[k]});
    field.sample(queries);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const LumenDistanceField::Sample alone = field.at(points[k], queries[k].from);
#if defined(__x86_64__) && !defined(__FMA__)
      // The same operations, each rounded by itself.
      EXPECT_EQ(samples[k].clearance_mm, alone.clearance_mm) << k;
      EXPECT_EQ(samples[k].gradient, alone.gradient) << k;
      EXPECT_EQ(samples[k].curvature(), alone.curvature()) << k;
#else
      // The same operations; the compiler may fuse some of them in one and not in the other: rounding, which
      // the search for the nearest place enlarges.
      EXPECT_NEAR(samples[k].clearance_mm, alone.clearance_mm, 1e-9) << k;
      EXPECT_LT((samples[k].gradient - alone.gradient).norm(), 1e-9) << k;
      EXPECT_LT((samples[k].curvature() - alone.curvature()).norm(), 1e-9 * (1 + alone.curvature().norm()))
          << k;
#endif
      EXPECT_EQ(samples[k].hint.branch, alone.hint.branch) << k;
      EXPECT_EQ(samples[k].hint.segment, alone.hint.segment) << k;
    }
  }
}

TEST(LumenDistanceField, IsSmoothAcrossABifurcation) {
  // Along the crotch of a fork, from one branch into the other, the wall's normal turns without a jump.
  const LumenDistanceField field(fork());
  LumenDistanceField::SearchHint hint = field.locate({-8, 0, 14});
  LumenDistanceField::Sample before = field.at({-8, 0, 14}, hint);
  constexpr int kSteps = 1600;
  double steepest = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const Vector3d point(-8 + 16.0 * i / kSteps, 0, 14);
    const LumenDistanceField::Sample now = field.at(point, before.hint);
    // No jump of the wall: a hundredth of a millimetre of way, and at most as much of clearance.
    EXPECT_LT(std::abs(now.clearance_mm - before.clearance_mm), 0.0105) << point.transpose();
    steepest = std::max(steepest, (now.gradient - before.gradient).norm());
    before = now;
  }
  // The ridge between the two is rounded over the blend of half a millimetre: its normals differ by
  // about 1.7, over some 0.6 mm of way, so by 0.03 a step of 0.01 mm. Unblended it would be 1.7 at once.
  EXPECT_LT(steepest, 0.06);
}

TEST(LumenDistanceField, VesselsThatTouchBeyondTheirForkAreApart) {
  // Two branches of 1 mm that part by so little that they overlap far beyond their fork.
  std::vector<VesselBranch> branches(3);
  for (int i = 0; i <= 20; ++i) branches[0].points.push_back({{0, 0, i - 20.0}, 1});
  for (const int side : {-1, 1})
    for (int i = 0; i <= 20; ++i)
      branches[side < 0 ? 1 : 2].points.push_back({{side * 0.05 * i, 0, 1.0 * i}, 1});
  branches[1].parent = branches[2].parent = 0;
  const LumenDistanceField field(VesselTree(branches, "touching"));
  const auto seen_from = [&](double z_mm, double x_mm) {
    return field.at({1.2, 0, z_mm}, field.locate({x_mm, 0, z_mm})).clearance_mm;
  };
  // Where they meet they are one lumen; farther away the wall of the branch that one is in counts.
  EXPECT_NEAR(seen_from(3, -1), seen_from(3, 1), 1e-9);
  EXPECT_GT(seen_from(8, 1), 0.15);
  EXPECT_LT(seen_from(8, -1), -0.55);
  // In between it grows without a jump: by some three times the way at most.
  constexpr double kStep_mm = 0.01;
  for (double z_mm = 3; z_mm < 8; z_mm += kStep_mm)
    EXPECT_NEAR(seen_from(z_mm, -1), seen_from(z_mm + kStep_mm, -1), 3 * kStep_mm) << z_mm;
}

TEST(LumenDistanceField, KnowsAPlaceBesideAStation) {
  // Stations stand at every half millimetre, and a point beside one is neither before it nor behind it.
  VesselBranch branch;
  for (int i = 0; i <= 20; ++i) branch.points.push_back({{0, 0, 1.0 * i}, 1});
  const LumenDistanceField field(VesselTree({branch}, "straight"));
  for (const int segment : {0, 9, 10, 39})
    EXPECT_NEAR(field.at({0.3, 0, 5}, {0, segment}).clearance_mm, 0.7, 1e-3)
        << segment;  // the centre is rounded
}

TEST(LumenDistanceField, WalkingAlongGivesWhatLookingEverywhereGives) {
  const VesselTree tree = phantom_tree("thorax");
  const LumenDistanceField field(tree);
  for (const VesselBranch& branch : tree.branches()) {
    if (branch.parent < 0) continue;
    // From the middle of the parent to this branch's end, never told where it is.
    const auto& parent = tree.branches()[static_cast<std::size_t>(branch.parent)];
    std::vector<Vector3d> way;
    for (std::size_t i = parent.points.size() / 2; i < parent.points.size(); ++i)
      way.push_back(to_eigen(parent.points[i].position_mm));
    for (const VesselPoint& point : branch.points) way.push_back(to_eigen(point.position_mm));
    LumenDistanceField::SearchHint hint = field.locate(way.front());
    for (const Vector3d& point : way) {
      const LumenDistanceField::Sample sample = field.at(point, hint);
      hint = sample.hint;
      // The two start from different stations; what they find is the same to rounding.
      EXPECT_NEAR(sample.clearance_mm, field.at(point, field.locate(point)).clearance_mm, 1e-6);
    }
    EXPECT_EQ(hint.branch, &branch - tree.branches().data());
  }
}

TEST(LumenDistanceField, OpeningGoesOnStraight) {
  const VesselTree tree = phantom_tree("thorax");
  for (const VesselEnd& end : vessel_ends(tree)) {
    const LumenDistanceField open(tree, &end, 30), closed(tree);
    const Vector3d outside = end.position_mm + 20 * end.outward;
    EXPECT_NEAR(open.at(outside, open.locate(outside)).clearance_mm, end.radius_mm, 0.05);
    EXPECT_LT(closed.at(outside, closed.locate(outside)).clearance_mm, 0);
    const Vector3d inside = end.position_mm - 1.0 * end.outward;
    const LumenDistanceField::Sample sample = open.at(inside, open.locate(inside));
    const double length = tree.branches()[static_cast<std::size_t>(end.branch)].arc_length_mm.back();
    // The opening leaves along the mean direction of the last radius.
    EXPECT_NEAR(sample.arc_length_mm, end.at_start ? 1 : length - 1, 0.2);
  }
}

}  // namespace
}  // namespace xraycast::lumen_distance_field_test
