#include "xraycast/segmentation/poor_results.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <optional>

namespace xraycast {

std::vector<std::string> poor_results(const Centrelines& centrelines, const VolumeGeometry& grid,
                                      const std::string& name) {
  // A whole head has 30 to 50 branches and a loop or two, a malformation of hundreds looks like noise and is
  // worth a look too.
  constexpr std::size_t kManyBranches = 200, kManyLoops = 5;
  constexpr double kCoarse_mm = 3;
  const glm::dvec3& s = grid.spacing_mm;
  const double coarsest_mm = std::max({s.x, s.y, s.z});
  const std::size_t branches = centrelines.tree.branches().size(), loops = centrelines.loops.size();
  std::vector<std::string> notes;
  if (branches == 1 && coarsest_mm >= kCoarse_mm)
    notes.push_back(fmt::format(
        "{}: found one branch only: voxels of {:g} mm show no thin vessels; give a scan with thinner slices, "
        "or `seeds` in the vessels that are missing",
        name, coarsest_mm));
  if (branches > kManyBranches || loops > kManyLoops)
    notes.push_back(fmt::format(
        "{}: found {} branches and {} loops, more than most trees have: noise, bone or a second lumen may "
        "be among them; look at the report, and give `window_hu`, `seeds`, or `not_vessels` in what is no "
        "vessel",
        name, branches, loops));
  return notes;
}

std::vector<std::string> wider_end(const VesselTree& tree, const std::string& name) {
  constexpr double kWider = 1.4, kFromEnd_mm = 5;  // an end is round, or cut aslant
  const auto width_mm = [](const VesselBranch& branch, double at_mm) {
    return 2 * point_at(branch, at_mm).radius_mm;
  };
  const VesselBranch& root = tree.branches()[static_cast<std::size_t>(tree.root())];
  const double root_mm = width_mm(root, kFromEnd_mm);
  double widest_mm = kWider * root_mm;
  std::optional<std::size_t> widest;
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    const double end_mm = width_mm(branch, branch.arc_length_mm.back() - kFromEnd_mm);
    if (!branch.children.empty() || branch.arc_length_mm.back() < 0.5 * end_mm || end_mm <= widest_mm)
      continue;
    widest_mm = end_mm;
    widest = b;
  }
  if (!widest) return {};
  const glm::dvec3 &begin_mm = root.points.front().position_mm,
                   &end_mm = tree.branches()[*widest].points.back().position_mm;
  return {
      fmt::format("{}: the tree begins at ({:.0f}, {:.0f}, {:.0f}) mm, where {} is {:.0f} mm wide; the end "
                  "of {} at ({:.0f}, "
                  "{:.0f}, {:.0f}) mm is {:.0f} mm wide: if blood comes in there, give it as `root_mm`",
                  name, begin_mm.x, begin_mm.y, begin_mm.z, tree.title(tree.root()), root_mm,
                  tree.title(static_cast<int>(*widest)), end_mm.x, end_mm.y, end_mm.z, widest_mm)};
}

std::vector<std::string> too_little(const VesselTree& tree, const VolumeGeometry& grid,
                                    const std::string& name) {
  const glm::dvec3 size_mm = grid.upper_mm() - grid.lower_mm();
  double mm = 0;
  for (const VesselBranch& branch : tree.branches()) mm += branch.arc_length_mm.back();
  if (3 * mm >= std::max({size_mm.x, size_mm.y, size_mm.z})) return {};
  return {fmt::format(
      "{}: found {:.0f} mm of vessels in all, which may be bone or calcium: the scan may show no "
      "contrast agent, or less than expected; look at the report, and give `seeds` in the vessels "
      "that are meant, or their `window_hu`",
      name, mm)};
}

std::vector<std::string> far_root(const VesselTree& tree, const std::optional<glm::dvec3>& root_mm,
                                  const std::string& name) {
  constexpr double kFar_mm = 10;  // read from a picture, a place is that of the vessel's end
  if (!root_mm) return {};
  const VesselPoint& begin = tree.branches()[static_cast<std::size_t>(tree.root())].points.front();
  const double far_mm = glm::distance(begin.position_mm, *root_mm);
  if (far_mm <= kFar_mm + begin.radius_mm) return {};
  return {fmt::format(
      "{}: `root_mm` lies {:.0f} mm from the nearest end, that of {} at ({:.0f}, {:.0f}, {:.0f}) mm, where "
      "the tree begins; look at the report",
      name, far_mm, tree.title(tree.root()), begin.position_mm.x, begin.position_mm.y, begin.position_mm.z)};
}

}  // namespace xraycast
