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

}  // namespace xraycast
