#include "xraycast/radii/lumen_of_lines.hpp"

#include "xraycast/evidence/place_in_tube.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace xraycast {
namespace {

/// The wall through a voxel is taken for flat; a thin tube fills no more of one than it has. Voxels that the
/// axis passes through the middle of are in the mask however thin the tube is.
void add_tube_piece(const VesselPoint& a, const VesselPoint& b, Mask& mask, LumenFill& fill) {
  constexpr double kTouched = 0.1, kHalf = 0.5;
  const double least = fill.is_of_touched_voxels ? kTouched : kHalf;
  const VolumeGeometry& grid = mask.geometry;
  const glm::dvec3 s = grid.spacing_mm, from = grid.to_index(a.position_mm),
                   to = grid.to_index(b.position_mm);
  const double voxel_mm = std::cbrt(s.x * s.y * s.z);
  const glm::dvec3 reach = (std::max(a.radius_mm, b.radius_mm) + voxel_mm) / s;
  const Index3 lower = glm::max(Index3(glm::ceil(glm::min(from, to) - reach)), Index3(0)),
               upper = glm::min(Index3(glm::floor(glm::max(from, to) + reach)), grid.size - Index3(1));
  for (std::int64_t z = lower.z; z <= upper.z; ++z)
    for (std::int64_t y = lower.y; y <= upper.y; ++y)
      for (std::int64_t x = lower.x; x <= upper.x; ++x) {
        const PlaceInTube place = place_in_tube(grid.to_world_mm(glm::dvec3(x, y, z)), a, b);
        const double all = std::numbers::pi * place.radius_mm * place.radius_mm / (voxel_mm * voxel_mm),
                     fraction = std::clamp(0.5 - place.out_mm() / voxel_mm, 0.0, std::min(all, 1.0));
        if (fraction <= 0) continue;
        const auto at = static_cast<std::size_t>(offset_of(grid, {x, y, z}));
        if (fraction >= least || glm::length(place.from_axis_mm) < 0.5 * voxel_mm) mask.voxels[at] = 1;
        fill.fractions[at] = std::max(fill.fractions[at], quantised_fraction(fraction));
      }
}

}  // namespace

void add_lumen_of_lines(const std::vector<std::vector<VesselPoint>>& lines, Mask& mask, LumenFill& fill) {
  for (const std::vector<VesselPoint>& line : lines)
    for (std::size_t i = 0; i + 1 < line.size(); ++i) add_tube_piece(line[i], line[i + 1], mask, fill);
}

}  // namespace xraycast
