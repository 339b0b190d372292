#include "xraycast/skeleton/lumen.hpp"

#include "xraycast/evidence/axes_across.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/trilinear.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

/// Trilinear; beyond the grid the value at its border.
template <typename T>
double interpolate(const Mask& grid, const std::vector<T>& values, const glm::dvec3& world_mm) {
  const Index3 size = grid.geometry.size;
  const glm::dvec3 at =
      glm::clamp(grid.geometry.to_index(world_mm), glm::dvec3(0), glm::dvec3(size - Index3(1)));
  const Index3 low(glm::min(glm::floor(at), glm::dvec3(glm::max(size - Index3(2), Index3(0)))));
  return trilinear(grid, values, low, at - glm::dvec3(low));
}

}  // namespace

MaskLumen::MaskLumen(const Mask& mask) : mask_(mask), distance_mm_(distance_to_background_mm(mask)) {
  const glm::dvec3 s = mask.geometry.spacing_mm;
  voxel_mm_ = std::min({s.x, s.y, s.z});
  coarsest_mm_ = std::max({s.x, s.y, s.z});
}

bool MaskLumen::contains(const glm::dvec3& point_mm) const {
  const glm::dvec3 at = mask_.geometry.to_index(point_mm), last(mask_.geometry.size - Index3(1));
  return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x <= last.x && at.y <= last.y && at.z <= last.z;
}

double MaskLumen::inscribed_radius_mm(const glm::dvec3& point_mm) const {
  return std::max(least_radius_mm(), interpolate(mask_, distance_mm_, point_mm) - 0.5 * voxel_mm_);
}

double MaskLumen::occupancy(const glm::dvec3& point_mm) const {
  return interpolate(mask_, mask_.voxels, point_mm);
}

CrossSection cross_section(const Lumen& lumen, const glm::dvec3& point_mm, const glm::dvec3& tangent,
                           double reach_mm) {
  constexpr int kRays = 24;
  const auto [u, v] = axes_across(tangent);
  const double wall_mm = lumen.inscribed_radius_mm(point_mm), step_mm = 0.2 * lumen.voxel_mm(),
               first_mm = std::max(0.0, wall_mm - 1.5 * lumen.coarsest_mm()),
               middle_mm = wall_mm + 1.5 * lumen.coarsest_mm(),
               last_mm = std::max({2 * wall_mm, middle_mm, reach_mm});
  std::array<double, kRays> rays_mm{};
  CrossSection section;
  for (int k = 0; k < kRays; ++k) {
    const double angle = 2 * std::numbers::pi * k / kRays;
    const glm::dvec3 ray = std::cos(angle) * u + std::sin(angle) * v;
    double mm = first_mm, before = lumen.occupancy(point_mm + mm * ray);
    while (mm < last_mm && before > 0.5) {
      const double here = lumen.occupancy(point_mm + (mm + step_mm) * ray);
      if (here <= 0.5) {
        mm += step_mm * (before - 0.5) / (before - here);
        break;
      }
      mm += step_mm;
      before = here;
    }
    rays_mm[static_cast<std::size_t>(k)] = mm;
    section.to_middle_mm += 2.0 / kRays * std::min(mm, middle_mm) * ray;
  }
  std::ranges::nth_element(rays_mm, rays_mm.begin() + kRays / 2);
  section.radius_mm = rays_mm[kRays / 2];
  return section;
}

}  // namespace xraycast
