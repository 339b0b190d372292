#include "xraycast/given_vessels/surface_lumen.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {

SurfaceLumen::SurfaceLumen(const SurfaceDistance& wall, const Mask& mask) : wall_(wall), mask_(mask) {}

double SurfaceLumen::inscribed_radius_mm(const glm::dvec3& point_mm) const {
  const double mm = -wall_.at_mm(point_mm), known_mm = 0.9 * SurfaceDistance::kBand * wall_.spacing_mm();
  return std::max(least_radius_mm(),
                  mm < known_mm ? mm : std::max(known_mm, mask_.inscribed_radius_mm(point_mm)));
}

double SurfaceLumen::occupancy(const glm::dvec3& point_mm) const {
  return std::clamp(0.5 - wall_.at_mm(point_mm) / voxel_mm(), 0.0, 1.0);
}

LumenFill fill_of(const SurfaceDistance& wall, const VolumeGeometry& grid) {
  LumenFill fill(grid);
  const double voxel_mm = std::cbrt(grid.spacing_mm.x * grid.spacing_mm.y * grid.spacing_mm.z);
  for_each_voxel({{0, 0, 0}, grid.size}, [&](const Index3& voxel) {
    const double mm = wall.at_mm(grid.to_world_mm(glm::dvec3(voxel)));
    fill.fractions[offset_of(grid, voxel)] = quantised_fraction(0.5 - mm / voxel_mm);
  });
  return fill;
}

Mask half_full(const LumenFill& fill) {
  Mask mask(fill.geometry);
  std::ranges::transform(fill.fractions, mask.voxels.begin(), [](std::uint8_t fraction) {
    return static_cast<std::uint8_t>(2 * fraction >= LumenFill::kFull);
  });
  return mask;
}

VolumeGeometry grid_around(const Mesh& surface, std::int64_t voxels, double least_mm) {
  glm::dvec3 lower_mm(surface.points_mm.front()), upper_mm = lower_mm;
  for (const glm::vec3& p : surface.points_mm)
    lower_mm = glm::min(lower_mm, glm::dvec3(p)), upper_mm = glm::max(upper_mm, glm::dvec3(p));
  const glm::dvec3 extent_mm = upper_mm - lower_mm;
  constexpr double kMargin_vox = 3;
  const auto size_at = [&](double spacing_mm) {
    return Index3(glm::ceil(extent_mm / spacing_mm + 2 * kMargin_vox)) + Index3(1);
  };
  double spacing_mm =
      std::max(least_mm, std::cbrt(extent_mm.x * extent_mm.y * extent_mm.z / static_cast<double>(voxels)));
  const auto count_at = [&](double mm) {
    const Index3 size = size_at(mm);
    return size.x * size.y * size.z;
  };
  while (count_at(spacing_mm) > voxels) spacing_mm *= 1.02;
  return {size_at(spacing_mm), glm::dvec3(spacing_mm), lower_mm - kMargin_vox * spacing_mm};
}

}  // namespace xraycast
