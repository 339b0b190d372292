#include "xraycast/catheter/vessel_entry.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/mechanics/vectors.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

using Eigen::Vector3d;

/// The chord over the last stretch of about a radius, which a bent last segment does not turn.
Vector3d outward_direction(const VesselBranch& branch, bool at_start) {
  const auto& points = branch.points;
  const VesselPoint& end = at_start ? points.front() : points.back();
  const auto count = points.size();
  std::size_t k = 1;
  const auto inner = [&](std::size_t i) { return at_start ? points[i] : points[count - 1 - i]; };
  while (k + 1 < count && glm::distance(inner(k).position_mm, end.position_mm) < end.radius_mm) ++k;
  return to_eigen(end.position_mm - inner(k).position_mm).normalized();
}

bool is_lower(const VesselEnd& a, const VesselEnd& b) { return a.position_mm.z() < b.position_mm.z(); }

bool fits(const VesselEnd& entry, const InstrumentModel& instrument) {
  return entry.radius_mm > instrument.radius_mm();
}

/// The ends that an instrument fits into, the widest first.
std::vector<VesselEnd> ends_for(const VesselTree& tree, const InstrumentModel& instrument) {
  std::vector<VesselEnd> ends = vessel_ends(tree);
  std::erase_if(ends, [&](const VesselEnd& end) { return !fits(end, instrument); });
  std::stable_sort(ends.begin(), ends.end(),
                   [](const VesselEnd& a, const VesselEnd& b) { return a.radius_mm > b.radius_mm; });
  return ends;
}

const VesselEnd& most_inferior(const std::vector<VesselEnd>& ends) {
  return *std::min_element(ends.begin(), ends.end(), is_lower);
}

VesselEnd end_of_branch(const VesselTree& tree, int branch, const std::string& name) {
  if (branch < 0 || branch >= static_cast<int>(tree.branches().size()))
    throw InputError("{}: there is no branch {}; the tree has branches 0 to {}", name, branch,
                     tree.branches().size() - 1);
  for (const VesselEnd& end : vessel_ends(tree))
    if (end.branch == branch) return end;
  throw InputError(
      "{}: branch {} bifurcates at its end and has a parent; choose a branch with an end of its own", name,
      branch);
}

/// The one end that a vessel of this name has.
VesselEnd end_named(const VesselTree& tree, const std::string& vessel, const std::string& name) {
  const std::vector<int> branches = branches_named(tree, vessel, name);
  std::vector<VesselEnd> ends = vessel_ends(tree);
  std::erase_if(ends, [&](const VesselEnd& end) {
    return !std::binary_search(branches.begin(), branches.end(), end.branch);
  });
  if (ends.empty())
    throw InputError("{}: this vessel goes on in others at its end; choose one that ends", name);
  if (ends.size() > 1 && ends.front().branch != ends.back().branch)
    throw InputError("{}: this vessel has {} ends, in branches {} to {}; choose one of these by its number",
                     name, ends.size(), ends.front().branch, ends.back().branch);
  return ends.front();
}

}  // namespace

std::string_view side_of_patient(const VesselTree& tree, const VesselEnd& end) {
  double low_mm = end.position_mm.x(), high_mm = low_mm;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      low_mm = std::min(low_mm, point.position_mm.x);
      high_mm = std::max(high_mm, point.position_mm.x);
    }
  const double from_middle_mm = end.position_mm.x() - 0.5 * (low_mm + high_mm);
  if (std::abs(from_middle_mm) <= 0.25 * (high_mm - low_mm)) return "";
  return from_middle_mm < 0 ? "right" : "left";
}

std::vector<VesselEnd> vessel_ends(const VesselTree& tree) {
  std::vector<VesselEnd> ends;
  const auto add = [&](int index, bool at_start) {
    const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(index)];
    const VesselPoint& point = at_start ? branch.points.front() : branch.points.back();
    ends.push_back(
        {index, at_start, to_eigen(point.position_mm), outward_direction(branch, at_start), point.radius_mm});
  };
  for (int i = 0; i < static_cast<int>(tree.branches().size()); ++i) {
    if (i == tree.root()) add(i, true);
    if (tree.branches()[static_cast<std::size_t>(i)].children.empty()) add(i, false);
  }
  return ends;
}

VesselEnd most_inferior_end(const VesselTree& tree) { return most_inferior(vessel_ends(tree)); }

VesselEnd nearest_end(const VesselTree& tree, const glm::dvec3& point_mm) {
  const std::vector<VesselEnd> ends = vessel_ends(tree);
  const auto away_mm = [&](const VesselEnd& end) { return glm::distance(to_glm(end.position_mm), point_mm); };
  return *std::min_element(ends.begin(), ends.end(),
                           [&](const VesselEnd& a, const VesselEnd& b) { return away_mm(a) < away_mm(b); });
}

VesselEnd find_entry(const VesselTree& tree, const EntryChoice& choice, const InstrumentModel& instrument) {
  if (const int* branch = std::get_if<int>(&choice.end)) return end_of_branch(tree, *branch, choice.name);
  if (const auto* vessel = std::get_if<std::string>(&choice.end))
    return end_named(tree, *vessel, choice.name);
  if (const auto* point_mm = std::get_if<glm::dvec3>(&choice.end)) {
    VesselEnd nearest = nearest_end(tree, *point_mm);
    check_near_end(to_glm(nearest.position_mm), *point_mm, choice.name);
    return nearest;
  }
  const std::vector<VesselEnd> ends = ends_for(tree, instrument);
  return ends.empty() ? most_inferior_end(tree) : most_inferior(ends);
}

std::vector<VesselEnd> equally_low_ends(const VesselTree& tree, const VesselEnd& entry,
                                        const InstrumentModel& instrument) {
  std::vector<VesselEnd> ends = ends_for(tree, instrument);
  std::erase_if(ends, [&](const VesselEnd& end) {
    const bool is_entry = end.branch == entry.branch && end.at_start == entry.at_start;
    return is_entry || end.position_mm.z() > entry.position_mm.z() + kEquallyLow_mm;
  });
  std::stable_sort(ends.begin(), ends.end(), is_lower);
  return ends;
}

void check_fits(const VesselTree& tree, const VesselEnd& entry, const InstrumentModel& instrument) {
  if (fits(entry, instrument)) return;
  constexpr std::size_t kMaxNamed = 3;
  std::string wide_enough;
  std::vector<VesselEnd> ends = ends_for(tree, instrument);
  if (ends.size() > kMaxNamed) ends.resize(kMaxNamed);
  for (const VesselEnd& end : ends)
    wide_enough += fmt::format("{}{:.0f},{:.0f},{:.0f} ({}, {:.2g} mm wide)",
                               wide_enough.empty() ? "" : " or ", end.position_mm.x(), end.position_mm.y(),
                               end.position_mm.z(), tree.title(end.branch), 2 * end.radius_mm);
  throw InputError("{}: its diameter of {} does not fit into {}, which has {:.3g} mm at its end; {}",
                   instrument.name(), diameter_text(instrument), tree.title(entry.branch),
                   2 * entry.radius_mm,
                   wide_enough.empty() ? "nor into any other end; choose a thinner instrument"
                                       : "choose another entry, such as " + wide_enough);
}

}  // namespace xraycast
