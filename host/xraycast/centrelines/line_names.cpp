#include "xraycast/centrelines/line_names.hpp"

#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/geometry/segment_index.hpp"

#include <algorithm>
#include <map>
#include <string>

namespace xraycast {
namespace {

/// The segments of all lines of one name.
using NamedSegments = std::map<std::string, std::vector<SegmentIndex::Segment>>;

NamedSegments segments_by_name(const std::vector<CentrelineLine>& lines) {
  NamedSegments segments;
  for (const CentrelineLine& line : lines) {
    const std::string name = vessel_name_of(line.name);
    if (name.empty()) continue;
    for (std::size_t k = 1; k < line.points_mm.size(); ++k)
      if (line.points_mm[k - 1] != line.points_mm[k])
        segments[name].push_back(
            {line.points_mm[k - 1], line.points_mm[k], line.radii_mm[k - 1], line.radii_mm[k], 0, 0});
  }
  return segments;
}

/// Whether lines run along most of a branch: within what joining them may have moved it.
bool run_along(const SegmentIndex& lines, const VesselBranch& branch) {
  constexpr double kBeside = 0.3, kLeast_mm = 0.01, kMost = 0.8;
  std::size_t along = 0;
  for (const VesselPoint& point : branch.points)
    along += lines.nearest(point.position_mm).distance_mm <= std::max(kLeast_mm, kBeside * point.radius_mm);
  return static_cast<double>(along) >= kMost * static_cast<double>(branch.points.size());
}

}  // namespace

VesselTree with_names_of_lines(const VesselTree& tree, const std::vector<CentrelineLine>& lines) {
  const NamedSegments segments = segments_by_name(lines);
  if (segments.empty()) return tree;
  std::vector<std::string> names(tree.branches().size());
  std::vector<int> runs(names.size(), 0);
  for (const auto& [name, of_name] : segments) {
    const SegmentIndex index(of_name);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!run_along(index, tree.branches()[i])) continue;
      names[i] = ++runs[i] == 1 ? name : "";
    }
  }
  return with_branch_names(tree, names);
}

}  // namespace xraycast
