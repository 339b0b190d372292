#include "xraycast/given_vessels/one_component.hpp"

#include "xraycast/base/pluralize.hpp"
#include "xraycast/mask/components.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <limits>

namespace xraycast {
namespace {

/// The component of a mask that lies nearest to a point; without one, the largest.
int chosen(const Components& components, const VolumeGeometry& grid, const std::optional<glm::dvec3>& at_mm) {
  if (!at_mm) return components.largest();
  int best = -1;
  double nearest_mm = std::numeric_limits<double>::infinity();
  for (const Components::Run& run : components.runs())
    for (std::int32_t i = 0; i < run.length; ++i) {
      const double mm = glm::distance(*at_mm, grid.to_world_mm(glm::dvec3(voxel_at(grid, run.first + i))));
      if (mm < nearest_mm) nearest_mm = mm, best = run.component;
    }
  return best;
}

}  // namespace

Mask one_component(const Mask& mask, const std::optional<glm::dvec3>& at_mm, const std::string& name,
                   std::vector<std::string>& notes) {
  const Components components(mask);
  if (components.count() <= 1) return mask;
  const int kept = chosen(components, mask.geometry, at_mm);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  keep[static_cast<std::size_t>(kept)] = true;
  notes.push_back(fmt::format(
      "{}: {} that do not touch; kept the {} ({:.0f} % of the volume); `component_mm` chooses another by a "
      "point",
      name, pluralize(components.count(), "component"), at_mm ? "chosen one" : "largest one",
      100.0 * static_cast<double>(components.voxels(kept)) / static_cast<double>(mask.count())));
  return components.select(keep);
}

}  // namespace xraycast
