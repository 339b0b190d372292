#include "xraycast/casting/rays_within.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

/// From where to where, in units of `along`, a line is nearer than `radius` to the origin.
template <typename Vector>
std::optional<glm::dvec2> within_radius(const Vector& from, const Vector& along, double radius) {
  const double a = glm::dot(along, along), b = glm::dot(from, along),
               c = glm::dot(from, from) - radius * radius;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (a < 1e-18) return c < 0 ? std::optional(glm::dvec2(-kInfinity, kInfinity)) : std::nullopt;
  const double inside = b * b - a * c;
  if (inside <= 0) return std::nullopt;
  const double root = std::sqrt(inside);
  return glm::dvec2(-b - root, -b + root) / a;
}

}  // namespace

std::vector<std::optional<RaySegment>> rays_within(const View& view, const MapGeometry& geometry) {
  if (geometry.centre_mm.size() > 1)
    throw InputError("a map with a curved axis cannot be compared; cast it with a straight axis");
  const bool is_sphere = geometry.projection == Projection::sphere;
  const glm::dvec3 centre(geometry.centre_mm[0], geometry.centre_z_mm);
  const double top_mm = geometry.z_mm(-0.5), bottom_mm = geometry.z_mm(geometry.height - 0.5);
  std::vector<std::optional<RaySegment>> rays;
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i) {
      const glm::dvec3 pixel = view.pixel_on_detector_mm(i, j);
      const glm::dvec3 along = view.cone ? glm::normalize(pixel - view.source_mm()) : view.towards_detector();
      const glm::dvec3 from = pixel - centre;
      auto range = is_sphere ? within_radius(from, along, geometry.radius_mm())
                             : within_radius(glm::dvec2(from), glm::dvec2(along), geometry.radius_mm());
      if (range && !is_sphere) {
        const double rise = std::abs(along.z) < 1e-12 ? std::copysign(1e-12, along.z) : along.z;
        const double a = (bottom_mm - pixel.z) / rise, b = (top_mm - pixel.z) / rise;
        range = glm::dvec2(std::max(range->x, std::min(a, b)), std::min(range->y, std::max(a, b)));
      }
      if (range && range->x < range->y)
        rays.push_back(RaySegment{pixel + range->x * along, pixel + range->y * along});
      else
        rays.emplace_back();
    }
  return rays;
}

}  // namespace xraycast
