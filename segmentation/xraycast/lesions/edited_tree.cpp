#include "xraycast/lesions/edited_tree.hpp"

#include "xraycast/lesions/placed_edits.hpp"
#include "xraycast/lesions/tube_places.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// Where a dead end begins: at the end of a branch, which may have to be split there.
struct Root {
  int parent;
  VesselPoint point;
};

/// Splits a branch at an arc length, unless one of its ends is as near as its own points are apart.
Root split_at(std::vector<VesselBranch>& branches, const TubePlace& place, double at_mm) {
  const auto host = static_cast<std::size_t>(place.branch);
  const double length_mm = branches[host].arc_length_mm.back();
  constexpr double kEnd_mm = 0.2;
  if (at_mm > length_mm - kEnd_mm) return {place.branch, branches[host].points.back()};
  if (at_mm < kEnd_mm && branches[host].parent >= 0)
    return {branches[host].parent, branches[host].points.front()};
  at_mm = std::max(at_mm, kEnd_mm);
  const VesselPoint middle = point_at(branches[host], at_mm);
  VesselBranch rest = branches[host];
  std::vector<VesselPoint> first, last{middle};
  for (std::size_t k = 0; k < rest.points.size(); ++k) {
    constexpr double kBeside_mm = 1e-3;
    const double before_mm = at_mm - rest.arc_length_mm[k];
    if (before_mm > kBeside_mm || k == 0) first.push_back(rest.points[k]);
    if (before_mm < -kBeside_mm) last.push_back(rest.points[k]);
  }
  first.push_back(middle);
  const auto number = static_cast<int>(branches.size());
  for (VesselBranch& branch : branches)
    if (branch.parent == place.branch) branch.parent = number;
  branches[host].points = std::move(first);
  rest.points = std::move(last);
  rest.parent = place.branch;
  branches.push_back(std::move(rest));
  return {place.branch, middle};
}

}  // namespace

VesselTree without_branches(const VesselTree& tree, const std::vector<bool>& is_removed) {
  std::vector<int> number(is_removed.size(), -1);
  std::vector<VesselBranch> kept;
  for (std::size_t b = 0; b < is_removed.size(); ++b)
    if (!is_removed[b]) {
      number[b] = static_cast<int>(kept.size());
      kept.push_back(tree.branches()[b]);
    }
  for (VesselBranch& branch : kept)
    if (branch.parent >= 0) branch.parent = number[static_cast<std::size_t>(branch.parent)];
  return VesselTree(std::move(kept), "the edited tree");
}

TreeWithSac with_sac(const VesselTree& tree, const SacBall& ball, double neck_mm) {
  const TubePlace place = TubePlaces(tree).deepest(ball.wall_mm);
  std::vector<VesselBranch> branches = tree.branches();
  const Root root = split_at(branches, place, place.arc_length_mm(tree));
  const glm::dvec3 axis_mm = ball.centre_mm() - root.point.position_mm, outwards = glm::normalize(axis_mm);
  const double neck_radius_mm = std::min(0.5 * neck_mm, 0.5 * root.point.radius_mm),
               to_centre_mm = glm::length(axis_mm), end_mm = to_centre_mm + 0.5 * ball.radius_mm;
  VesselBranch sac{
      .points = {}, .parent = root.parent, .children = {}, .arc_length_mm = {}, .name = "aneurysm"};
  // The centre is a point, where the radius is the ball's.
  const double step_mm = std::min(0.5, ball.radius_mm / 8);
  const int inner = std::max(4, static_cast<int>(std::ceil(to_centre_mm / step_mm))),
            outer = std::max(2, static_cast<int>(std::ceil((end_mm - to_centre_mm) / step_mm)));
  for (int i = 0; i <= inner + outer; ++i) {
    const double at_mm = i <= inner ? to_centre_mm * i / inner
                                    : std::lerp(to_centre_mm, end_mm, static_cast<double>(i - inner) / outer);
    sac.points.push_back({root.point.position_mm + at_mm * outwards,
                          std::max(neck_radius_mm, ball.radius_mm - std::abs(at_mm - to_centre_mm))});
  }
  sac.points.front().position_mm = root.point.position_mm;
  branches.push_back(std::move(sac));
  const auto number = static_cast<int>(branches.size()) - 1;
  return {VesselTree(std::move(branches), "the edited tree"), number};
}

VesselTree scaled(const VesselTree& tree, double factor) {
  std::vector<VesselBranch> branches = tree.branches();
  const glm::dvec3 fixed_mm = branches[static_cast<std::size_t>(tree.root())].points.front().position_mm;
  for (VesselBranch& branch : branches)
    for (VesselPoint& point : branch.points) {
      point.position_mm = fixed_mm + factor * (point.position_mm - fixed_mm);
      point.radius_mm *= factor;
    }
  return VesselTree(std::move(branches), "the edited tree");
}

}  // namespace xraycast
