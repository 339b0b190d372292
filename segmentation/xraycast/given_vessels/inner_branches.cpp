#include "xraycast/given_vessels/inner_branches.hpp"

#include "xraycast/evidence/place_in_tube.hpp"

#include <algorithm>
#include <iterator>

namespace xraycast {
namespace {

/// Whether a point lies in the lumen of a branch.
bool is_inside(const glm::dvec3& point_mm, const VesselBranch& branch) {
  for (std::size_t i = 1; i < branch.points.size(); ++i)
    if (place_in_tube(point_mm, branch.points[i - 1], branch.points[i]).out_mm() < 0) return true;
  return false;
}

/// Whether a branch without children lies with all its points in its parent and its siblings.
bool is_inner(const std::vector<VesselBranch>& branches, std::size_t leaf) {
  const int parent = branches[leaf].parent;
  return std::ranges::all_of(branches[leaf].points, [&](const VesselPoint& point) {
    for (std::size_t i = 0; i < branches.size(); ++i) {
      const bool is_beside = i != leaf && (static_cast<int>(i) == parent || branches[i].parent == parent);
      if (is_beside && is_inside(point.position_mm, branches[i])) return true;
    }
    return false;
  });
}

std::vector<std::size_t> children_of(const std::vector<VesselBranch>& branches, int parent) {
  std::vector<std::size_t> children;
  for (std::size_t i = 0; i < branches.size(); ++i)
    if (branches[i].parent == parent) children.push_back(i);
  return children;
}

/// Removes a branch without children.
void erase(std::vector<VesselBranch>& branches, std::size_t gone) {
  branches.erase(branches.begin() + static_cast<std::ptrdiff_t>(gone));
  for (VesselBranch& branch : branches)
    if (branch.parent > static_cast<int>(gone)) --branch.parent;
}

/// Lets a branch go on as its only child.
void join_only_child(std::vector<VesselBranch>& branches, int parent) {
  const std::vector<std::size_t> children = children_of(branches, parent);
  if (children.size() != 1) return;
  const std::size_t child = children.front();
  auto& points = branches[static_cast<std::size_t>(parent)].points;
  points.insert(points.end(), branches[child].points.begin() + 1, branches[child].points.end());
  for (VesselBranch& branch : branches)
    if (branch.parent == static_cast<int>(child)) branch.parent = parent;
  erase(branches, child);
}

}  // namespace

void remove_inner_branches(std::vector<VesselBranch>& branches) {
  for (std::size_t i = 0; i < branches.size();) {
    const int parent = branches[i].parent;
    const bool is_leaf = children_of(branches, static_cast<int>(i)).empty();
    if (parent < 0 || !is_leaf || !is_inner(branches, i)) {
      ++i;
      continue;
    }
    erase(branches, i);
    join_only_child(branches, parent > static_cast<int>(i) ? parent - 1 : parent);
    i = 0;  // what was a fork may be a leaf now
  }
}

}  // namespace xraycast
