#include "xraycast/given_vessels/surface_lumen.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

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

namespace {

/// A grid's voxels in cubes, of which few hold a wall.
struct WallBlocks {
  static constexpr std::int64_t kSide = 8;
  Index3 count;
  std::vector<char> has_wall;

  /// Those within a voxel of the wall, whose triangles are smaller than its spacing.
  WallBlocks(const SurfaceDistance& wall, const VolumeGeometry& grid)
      : count((grid.size + Index3(kSide - 1)) / kSide),
        has_wall(static_cast<std::size_t>(count.x * count.y * count.z)) {
    const glm::dvec3 margin = 1.0 + glm::ceil(wall.spacing_mm() / grid.spacing_mm);
    for (const glm::vec3& point_mm : wall.wall().points_mm) {
      const glm::dvec3 at = grid.to_index(point_mm);
      const Index3 low = glm::max(Index3(glm::floor(at - margin)), Index3(0)) / kSide,
                   high = glm::min(Index3(glm::ceil(at + margin)), grid.size - Index3(1));
      if (glm::any(glm::lessThan(high, Index3(0)))) continue;
      for (std::int64_t z = low.z; z <= high.z / kSide; ++z)
        for (std::int64_t y = low.y; y <= high.y / kSide; ++y)
          for (std::int64_t x = low.x; x <= high.x / kSide; ++x)
            has_wall[static_cast<std::size_t>((z * count.y + y) * count.x + x)] = 1;
    }
  }

  Box box(std::int64_t block, const Index3& size) const {
    const Index3 lower =
        kSide * Index3(block % count.x, block / count.x % count.y, block / (count.x * count.y));
    return {lower, glm::min(lower + Index3(kSide), size)};
  }
};

}  // namespace

LumenFill fill_of(const SurfaceDistance& wall, const VolumeGeometry& grid) {
  LumenFill fill(grid);
  const double voxel_mm = std::cbrt(grid.spacing_mm.x * grid.spacing_mm.y * grid.spacing_mm.z);
  const auto fraction = [&](const Index3& voxel) {
    return quantised_fraction(0.5 - wall.at_mm(grid.to_world_mm(glm::dvec3(voxel))) / voxel_mm);
  };
  const WallBlocks blocks(wall, grid);
  parallel_for(std::ssize(blocks.has_wall), [&](std::int64_t b) {
    const auto [lower, upper] = blocks.box(b, grid.size);
    const bool has_wall = blocks.has_wall[static_cast<std::size_t>(b)] != 0;
    // Without a wall all of it lies on one side.
    const auto alike = static_cast<std::uint8_t>(
        !has_wall && wall.at_mm(grid.to_world_mm(glm::dvec3(lower))) < 0 ? LumenFill::kFull : 0);
    for (std::int64_t z = lower.z; z < upper.z; ++z)
      for (std::int64_t y = lower.y; y < upper.y; ++y)
        for (std::int64_t x = lower.x; x < upper.x; ++x)
          fill.fractions[offset_of(grid, {x, y, z})] = has_wall ? fraction({x, y, z}) : alike;
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
