#include "xraycast/given_vessels/vessels_of_lines.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/centrelines/tree_of_lines.hpp"
#include "xraycast/given_vessels/surface_distance.hpp"
#include "xraycast/given_vessels/surface_lumen.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace xraycast {
namespace {

double least_radius_mm(const VesselTree& tree) {
  double least_mm = std::numeric_limits<double>::infinity();
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) least_mm = std::min(least_mm, point.radius_mm);
  return least_mm;
}

}  // namespace

Vessels vessels_of_lines(const std::vector<CentrelineLine>& lines, const GivenVesselsOptions& options,
                         const std::string& name, Progress& progress) {
  TreeOfLines found = tree_of_lines(lines, name, {options.root_mm, options.component_mm});
  progress.begin("surface", 1, "surfaces");
  const Mesh tubes = tube_mesh(found.tree);
  const double least_mm = least_radius_mm(found.tree);
  constexpr double kDistances = 4e6;  // no line is fitted to them
  const auto wall = surface_distance(tubes, spacing_of_distances_mm(tubes, least_mm, kDistances));
  if (wall->wall().triangles.empty())
    throw InputError("{}: no vessel: its lines are too thin for a surface", name);
  if (least_mm < wall->spacing_mm())
    found.notes.push_back(
        fmt::format("{}: vessels of less than {:.2g} mm in radius are in the tree, but not in its surface",
                    name, wall->spacing_mm()));
  constexpr std::int64_t kPictureVoxels = 20'000'000;
  LumenFill fill =
      fill_of(*wall, options.grid ? *options.grid : grid_around(tubes, kPictureVoxels, wall->spacing_mm()));
  Mask mask = half_full(fill);
  Mesh surface = with_fewer_triangles(wall->wall(), options.triangles);
  progress.advance();
  return {std::move(mask),
          std::move(fill),
          {std::move(found.tree), std::move(found.loops), {}, found.components_left_out},
          std::move(surface),
          {},
          0,
          std::move(found.notes),
          options.grid.has_value()};
}

}  // namespace xraycast
