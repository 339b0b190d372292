#include "xraycast/casting/outline_bands.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cstddef>

namespace xraycast {

std::vector<OutlineBand> outline_bands(const MapGeometry& geometry) {
  if (geometry.has_plane_outline()) return {{0, geometry.height}};
  std::vector<OutlineBand> bands{{0, 1}};
  for (int row = 1; row < geometry.height; ++row) {
    const auto above =
        geometry.outline_mm.begin() + static_cast<std::ptrdiff_t>(row - 1) * std::ptrdiff_t{geometry.width};
    if (std::equal(above, above + geometry.width, above + geometry.width))
      ++bands.back().rows;
    else
      bands.push_back({row, 1});
  }
  return bands;
}

void check_reach(const MapGeometry& geometry, const std::string& name) {
  if (!geometry.has_outline()) return;
  if (const float reach_mm = std::ranges::max(geometry.outline_mm);
      reach_mm < (1 - 1e-6) * geometry.radius_mm())
    throw InputError("{}: its outline reaches {:g} mm, but its shells {:g} mm", name, reach_mm,
                     geometry.radius_mm());
}

}  // namespace xraycast
