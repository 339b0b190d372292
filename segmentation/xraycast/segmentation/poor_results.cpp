#include "xraycast/segmentation/poor_results.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace xraycast {

std::vector<std::string> poor_results(const Centrelines& centrelines, const VolumeGeometry& grid,
                                      const std::string& name) {
  // A whole head has 30 to 50 branches, a malformation of hundreds looks like noise and is worth a look too.
  constexpr std::size_t kManyBranches = 200, kManyLoops = 20;
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

}  // namespace xraycast
