#include "xraycast/given_vessels/vessels_of_surface.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/union_find.hpp"
#include "xraycast/given_vessels/inner_branches.hpp"
#include "xraycast/given_vessels/one_component.hpp"
#include "xraycast/given_vessels/surface_crossings.hpp"
#include "xraycast/given_vessels/surface_distance.hpp"
#include "xraycast/given_vessels/surface_lumen.hpp"
#include "xraycast/given_vessels/surface_repair.hpp"
#include "xraycast/given_vessels/wall_fit.hpp"
#include "xraycast/segmentation/surface.hpp"
#include "xraycast/skeleton/junctions.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// Throws InputError where the vessels of a surface are wider than any or narrower than a wire: twice the
/// volume over the area is the radius of a long tube.
void check_size(const Mesh& mesh, const std::string& name) {
  constexpr double kWidest_mm = 60, kNarrowest_mm = 0.05;
  const double radius_mm = 2 * std::abs(volume_mm3(mesh)) / surface_area_mm2(mesh);
  if (radius_mm > kWidest_mm)
    throw InputError(
        "{}: its vessels would be {:.3g} mm wide; give the unit of its lengths with `unit`, or a "
        "surface of vessels alone",
        name, 2 * radius_mm);
  if (radius_mm < kNarrowest_mm)
    throw InputError(
        "{}: its vessels would be {:.2g} mm wide; give the unit of its lengths with `unit`: cm or m", name,
        2 * radius_mm);
}

/// The pieces of a wall that enclose a component of the mask of its lumen.
Mesh wall_around(const Mask& component, const Mesh& wall) {
  UnionFind pieces(wall.points_mm.size());
  for (const auto& [a, b, c] : wall.triangles) pieces.unite(a, b), pieces.unite(a, c);
  std::vector<std::int64_t> beside(wall.points_mm.size());  // points at the component less those that are not
  for (std::size_t i = 0; i < wall.points_mm.size(); ++i) {
    const Index3 voxel(glm::round(component.geometry.to_index(wall.points_mm[i])));
    beside[pieces.find(i)] += component.at(voxel) || touches(component, voxel, Sharing::corner) ? 1 : -1;
  }
  Mesh around;
  around.points_mm = wall.points_mm;
  for (const auto& triangle : wall.triangles)
    if (beside[pieces.find(triangle[0])] > 0) around.triangles.push_back(triangle);
  return around;
}

/// Lets a line end at a point, straight from where it is a radius away from it: beside a flat cap
/// cross-sections say little.
void end_at(const VesselPoint& end, std::vector<VesselPoint>& points) {
  const double step_mm = glm::distance(points[0].position_mm, points[1].position_mm);
  while (points.size() > 2 && glm::distance(points.back().position_mm, end.position_mm) < end.radius_mm)
    points.pop_back();
  const VesselPoint from = points.back();
  const auto steps = static_cast<int>(std::ceil(glm::distance(from.position_mm, end.position_mm) / step_mm));
  for (int k = 1; k <= steps; ++k)
    points.push_back(
        {glm::mix(from.position_mm, end.position_mm, static_cast<double>(k) / steps), end.radius_mm});
}

/// Lets the free ends of a tree that lie within an open vessel reach its opening. Returns how many openings
/// are ends of vessels.
std::size_t reach_openings(const std::vector<Opening>& openings, std::vector<VesselBranch>& branches) {
  std::size_t reached = 0;
  for (const Opening& opening : openings) {
    VesselBranch* nearest = nullptr;
    bool is_first = false;
    double nearest_mm = 3 * opening.radius_mm;
    for (VesselBranch& branch : branches) {
      const auto consider = [&](const VesselPoint& end, bool first) {
        const double mm = glm::distance(end.position_mm, opening.centre_mm);
        if (mm < nearest_mm) nearest_mm = mm, nearest = &branch, is_first = first;
      };
      if (branch.parent < 0) consider(branch.points.front(), true);
      if (branch.children.empty()) consider(branch.points.back(), false);
    }
    if (nearest == nullptr) continue;
    ++reached;
    const VesselPoint end = is_first ? nearest->points.front() : nearest->points.back();
    if (is_first) std::ranges::reverse(nearest->points);
    end_at({opening.centre_mm, end.radius_mm}, nearest->points);
    if (is_first) std::ranges::reverse(nearest->points);
  }
  return reached;
}

/// The branches that end where those of a list, numbers in `before`, ended.
std::vector<int> with_same_ends(const std::vector<int>& list, const std::vector<VesselBranch>& before,
                                const std::vector<VesselBranch>& after) {
  std::vector<int> numbers;
  for (const int i : list) {
    const glm::dvec3 end_mm = before[static_cast<std::size_t>(i)].points.back().position_mm;
    const auto found = std::ranges::find(
        after, end_mm, [](const VesselBranch& branch) { return branch.points.back().position_mm; });
    if (found != after.end()) numbers.push_back(static_cast<int>(found - after.begin()));
  }
  return numbers;
}

/// The tree with side branches from their parents' axes, and its ends at the openings.
Centrelines completed(Centrelines found, const Mesh& wall, const std::vector<Opening>& openings,
                      const std::string& name, std::vector<std::string>& notes) {
  std::vector<VesselBranch> branches = found.tree.branches();
  remove_inner_branches(branches);
  branches = VesselTree(std::move(branches), name).branches();  // with children
  found.loops = with_same_ends(found.loops, found.tree.branches(), branches);
  straighten_junctions(branches);
  fit_to_wall(branches, wall);
  const std::size_t ends = reach_openings(openings, branches), holes = openings.size() - ends;
  if (ends > 0) notes.push_back(fmt::format("{}: {} of vessels", name, pluralize(ends, "open end")));
  if (holes > 0) notes.push_back(fmt::format("{}: {} closed", name, pluralize(holes, "hole")));
  return {VesselTree(std::move(branches), name), std::move(found.loops), std::move(found.gaps_mm),
          found.parts_left_out};
}

}  // namespace

Vessels vessels_of_surface(const Mesh& surface, const GivenVesselsOptions& options, const std::string& name,
                           Progress& progress) {
  RepairedSurface given = repaired(surface, name);
  check_size(given.mesh, name);
  std::vector<std::string> notes = given.notes(name);
  if (const std::int64_t crossings = crossing_triangles(given.mesh); crossings > 0)
    notes.push_back(fmt::format("{}: {} of triangles cross each other; what overlaps counts as one vessel",
                                name, pluralize(crossings, "pair")));
  progress.begin("distances to the wall", 1, "surfaces");
  auto wall = surface_distance(given.mesh, spacing_of_distances_mm(given.mesh));
  if (wall->wall().triangles.empty())
    throw InputError("{}: no vessel: the surface encloses nothing as wide as {:.2g} mm", name,
                     wall->spacing_mm());
  progress.advance();

  LumenFill fill = fill_of(*wall, grid_around(wall->wall(), options.voxels, wall->spacing_mm()));
  Mask mask = half_full(fill);
  if (Mask kept = one_component(mask, options.component_mm, name, notes); kept.voxels != mask.voxels) {
    wall = surface_distance(wall_around(kept, wall->wall()), wall->spacing_mm());
    fill = fill_of(*wall, kept.geometry);
    mask = std::move(kept);
  }
  const SurfaceLumen lumen(*wall, mask);
  Centrelines centrelines =
      completed(extract_centrelines(mask, name, progress, options.root_mm, nullptr, &lumen), wall->wall(),
                given.openings, name, notes);
  if (options.grid) {
    fill = fill_of(*wall, *options.grid);
    mask = half_full(fill);
  }
  progress.begin("surface", 1, "surfaces");
  const bool is_whole = given.pieces == 1 && is_watertight(given.mesh);
  Mesh closed = is_whole ? std::move(given.mesh) : with_fewer_triangles(wall->wall(), options.triangles);
  progress.advance();
  return {std::move(mask),  std::move(fill),         std::move(centrelines), std::move(closed), {}, 0,
          std::move(notes), options.grid.has_value()};
}

}  // namespace xraycast
