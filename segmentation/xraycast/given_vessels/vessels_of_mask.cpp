#include "xraycast/given_vessels/vessels_of_mask.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/given_vessels/one_component.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>

namespace xraycast {
namespace {

LumenFill full_fill(const Mask& mask) {
  LumenFill fill(mask.geometry);
  std::ranges::transform(mask.voxels, fill.fractions.begin(), [](std::uint8_t inside) {
    return static_cast<std::uint8_t>(inside != 0 ? LumenFill::kFull : 0);
  });
  return fill;
}

/// A mask of a part of a grid on all of it; one whose voxels are not those of the grid as it is.
LabelledMask on_grid(LabelledMask labelled, const VolumeGeometry& grid) {
  constexpr double kTolerance = 0.05;  // of a voxel
  const VolumeGeometry& own = labelled.mask.geometry;
  const glm::dvec3 at = grid.to_index(own.origin_mm),
                   far = grid.to_index(own.to_world_mm(own.size - Index3(1)));
  const Index3 first(glm::round(at));
  const bool is_part = glm::all(glm::lessThan(glm::abs(at - glm::dvec3(first)), glm::dvec3(kTolerance))) &&
                       glm::all(glm::lessThan(glm::abs(far - glm::dvec3(first + own.size - Index3(1))),
                                              glm::dvec3(kTolerance))) &&
                       glm::all(glm::greaterThanEqual(first, Index3(0))) &&
                       glm::all(glm::lessThanEqual(first + own.size, grid.size));
  if (!is_part || own == grid) return labelled;
  LabelledMask all{Mask(grid), {}, std::move(labelled.names), std::move(labelled.notes)};
  all.structures.resize(labelled.structures.empty() ? 0 : all.mask.voxels.size());
  for_each_voxel({{0, 0, 0}, own.size}, [&](const Index3& voxel) {
    const std::size_t from = labelled.mask.offset(voxel), to = all.mask.offset(voxel + first);
    all.mask.voxels[to] = labelled.mask.voxels[from];
    if (!all.structures.empty()) all.structures[to] = labelled.structures[from];
  });
  return all;
}

/// The names of the structures in which most points of each branch lie.
std::vector<std::string> names_of_structures(const VesselTree& tree, const LabelledMask& labelled) {
  std::vector<std::string> names;
  const VolumeGeometry& grid = labelled.mask.geometry;
  for (const VesselBranch& branch : tree.branches()) {
    std::vector<std::size_t> points(labelled.names.size() + 1, 0);
    for (const VesselPoint& point : branch.points) {
      const Index3 voxel =
          glm::clamp(Index3(glm::round(grid.to_index(point.position_mm))), Index3(0), grid.size - Index3(1));
      ++points[labelled.structures[labelled.mask.offset(voxel)]];
    }
    points[0] = 0;  // of no structure
    const auto most = std::ranges::max_element(points) - points.begin();
    names.push_back(most == 0 ? "" : labelled.names[static_cast<std::size_t>(most) - 1]);
  }
  return names;
}

}  // namespace

Vessels vessels_of_mask(LabelledMask labelled, const Volume* scan, const GivenVesselsOptions& options,
                        const std::string& name, Progress& progress) {
  if (scan != nullptr) labelled = on_grid(std::move(labelled), scan->geometry());
  if (scan != nullptr) check_mask_grid(labelled.mask.geometry, scan->geometry(), name);
  std::vector<std::string> notes = labelled.notes;
  Mask mask = one_component(labelled.mask, options.component_mm, name, notes);
  LumenFill fill = scan != nullptr ? fill_of(*scan, mask) : full_fill(mask);
  Centrelines centrelines = extract_centrelines(mask, name, progress, options.root_mm, &fill);
  if (!labelled.structures.empty())
    centrelines.tree = with_branch_names(centrelines.tree, names_of_structures(centrelines.tree, labelled));
  progress.begin("surface", 1, "surfaces");
  Mesh surface = surface_of(mask, fill, options.triangles);
  progress.advance();
  return {std::move(mask), std::move(fill), std::move(centrelines), std::move(surface), {}, 0,
          std::move(notes)};
}

}  // namespace xraycast
