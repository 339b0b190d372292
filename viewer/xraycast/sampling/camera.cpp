#include "xraycast/sampling/camera.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

}  // namespace

bool BodyBounds::holds(const glm::dvec3& point_mm) const {
  const glm::dvec3 from_centre_mm = point_mm - centre_mm;
  return std::hypot(from_centre_mm.x, from_centre_mm.y) <= radius_mm &&
         std::abs(from_centre_mm.z) <= half_height_mm;
}

BodyBounds bounds_of(const MapGeometry& geometry) {
  BodyBounds bounds;
  glm::dvec2 low = geometry.centre_mm.front(), high = low;
  for (const glm::dvec2& centre : geometry.centre_mm) {
    low = glm::min(low, centre);
    high = glm::max(high, centre);
  }
  const glm::dvec2 centre = 0.5 * (low + high);
  bounds.radius_mm = geometry.radius_mm() + 0.5 * glm::distance(low, high);
  bounds.finest_mm = geometry.step_mm;
  if (geometry.projection == Projection::sphere) {
    bounds.centre_mm = {centre, geometry.centre_z_mm};
    bounds.half_height_mm = geometry.radius_mm();
  } else {
    bounds.centre_mm = {centre, geometry.z_mm(0.5 * (geometry.height - 1))};
    bounds.half_height_mm = 0.5 * geometry.height * geometry.row_spacing_mm;
    bounds.finest_mm = std::min(bounds.finest_mm, geometry.row_spacing_mm);
  }
  return bounds;
}

void Camera::rotate(double degrees) {
  angle_rad = std::remainder(angle_rad + degrees * kRadians, 2 * std::numbers::pi);
}

void Camera::tilt(double degrees) {
  tilt_rad = std::clamp(tilt_rad + degrees * kRadians, -kMaxTilt_rad, kMaxTilt_rad);
}

void Camera::travel(double mm, const BodyBounds& bounds) {
  table_mm = std::clamp(table_mm + mm, -bounds.half_height_mm, bounds.half_height_mm);
}

void Camera::travel(const glm::dvec3& mm, const BodyBounds& bounds) {
  travel(mm.z, bounds);
  const glm::dvec2 farthest(bounds.radius_mm);
  across_mm = glm::clamp(across_mm + glm::dvec2(mm), -farthest, farthest);
}

void Camera::magnify(double times) { zoom = std::clamp(zoom * times, kMinZoom, kMaxZoom); }

View fitted(View view, const BodyBounds& bounds) {
  // A scan of one voxel across, as large as the bounds: `fitted` asks for its height and spacing alone.
  VolumeGeometry volume{{1, 1, 1},
                        {bounds.finest_mm, bounds.finest_mm, bounds.finest_mm},
                        {bounds.centre_mm.x, bounds.centre_mm.y, bounds.centre_mm.z - bounds.half_height_mm}};
  volume.size.z =
      std::max<std::int64_t>(1, std::llround(std::ceil(2 * bounds.half_height_mm / bounds.finest_mm - 1e-6)));
  volume.origin_mm.z += 0.5 * bounds.finest_mm;
  return fitted(view, volume, {glm::dvec2(bounds.centre_mm), bounds.radius_mm});
}

View view_of(const Camera& camera, const BodyBounds& bounds, int width, int height) {
  View view{.angle_rad = camera.angle_rad,
            .tilt_rad = camera.tilt_rad,
            .cone = camera.cone,
            .centre_mm = bounds.centre_mm,
            .width = width,
            .height = height};
  // The magnification is that of the untilted picture: tilting does not change it.
  View untilted = view;
  untilted.tilt_rad = 0;
  view.pixel_mm = fitted(untilted, bounds).pixel_mm / camera.zoom;
  view.centre_mm += glm::dvec3(camera.across_mm, camera.table_mm);
  return fitted(view, bounds);
}

std::string status_of(const Camera& camera) {
  const View view{.angle_rad = camera.angle_rad, .tilt_rad = camera.tilt_rad};
  return fmt::format("{}   table {:+.0f} mm   x{:.2g}", label(view), camera.table_mm + 0.0, camera.zoom);
}

}  // namespace xraycast
