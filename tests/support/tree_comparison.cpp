#include "support/tree_comparison.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <vector>

namespace xraycast {
namespace {

const VesselBranch& branch_of(const VesselTree& tree, int i) {
  return tree.branches()[static_cast<std::size_t>(i)];
}

std::vector<int> leaves_of(const VesselTree& tree) {
  std::vector<int> leaves;
  for (int i = 0; i < static_cast<int>(tree.branches().size()); ++i)
    if (branch_of(tree, i).children.empty()) leaves.push_back(i);
  return leaves;
}

/// The leaves that lie beyond each branch, in numbers that `number` gives them.
std::set<std::set<int>> leaf_sets(const VesselTree& tree, const std::map<int, int>& number) {
  std::map<int, std::set<int>> beyond;
  for (const auto& [leaf, its] : number)
    for (int i = leaf; i >= 0; i = branch_of(tree, i).parent) beyond[i].insert(its);
  std::set<std::set<int>> sets;
  for (const auto& [branch, leaves] : beyond) sets.insert(leaves);
  return sets;
}

bool is_whole(const VesselTree& truth, const VesselTree& found) {
  const std::vector<int> ends = leaves_of(truth), found_ends = leaves_of(found);
  if (ends.size() != found_ends.size()) return false;
  std::map<int, int> number, own;
  for (const int leaf : ends) {
    const VesselPoint& end = branch_of(truth, leaf).points.back();
    const auto away_mm = [&](int other) {
      return glm::distance(branch_of(found, other).points.back().position_mm, end.position_mm);
    };
    const int nearest = *std::ranges::min_element(found_ends, {}, away_mm);
    if (away_mm(nearest) > 0.5 * end.radius_mm + 0.5) return false;
    if (!number.emplace(nearest, leaf).second) return false;
    own.emplace(leaf, leaf);
  }
  return leaf_sets(found, number) == leaf_sets(truth, own);
}

}  // namespace

TreeDifference tree_difference(const VesselTree& truth, const VesselTree& found) {
  std::vector<double> off_mm, radii;
  for (const VesselBranch& branch : truth.branches()) {
    const double parent_mm = branch.parent < 0 ? 0 : branch_of(truth, branch.parent).points.back().radius_mm;
    const double inside_mm = branch.parent < 0 ? 0 : parent_mm + 0.5 * branch.points.front().radius_mm;
    for (const VesselPoint& point : branch.points) {
      if (glm::distance(point.position_mm, branch.points.front().position_mm) < inside_mm) continue;
      const VesselTree::Location at = found.nearest(point.position_mm);
      off_mm.push_back(at.distance_mm);
      radii.push_back(std::abs(at.radius_mm / point.radius_mm - 1));
    }
  }
  std::ranges::sort(off_mm);
  std::ranges::sort(radii);
  return {is_whole(truth, found), off_mm[off_mm.size() * 95 / 100], radii[radii.size() * 95 / 100]};
}

}  // namespace xraycast
