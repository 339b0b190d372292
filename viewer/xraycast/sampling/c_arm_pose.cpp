#include "xraycast/sampling/c_arm_pose.hpp"

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
  if (geometry.ray_layout == RayLayout::sphere) {
    bounds.centre_mm = {centre, geometry.centre_z_mm};
    bounds.half_height_mm = geometry.radius_mm();
  } else {
    bounds.centre_mm = {centre, geometry.z_mm(0.5 * (geometry.height - 1))};
    bounds.half_height_mm = 0.5 * geometry.height * geometry.row_spacing_mm;
    bounds.finest_mm = std::min(bounds.finest_mm, geometry.row_spacing_mm);
  }
  return bounds;
}

void CArmPose::rotate(double degrees) {
  lao_rad = std::remainder(lao_rad + degrees * kRadians, 2 * std::numbers::pi);
}

void CArmPose::tilt(double degrees) {
  cranial_rad = std::clamp(cranial_rad + degrees * kRadians, -kMaxTilt_rad, kMaxTilt_rad);
}

void CArmPose::travel(double mm, const BodyBounds& bounds) {
  table_mm = std::clamp(table_mm + mm, -bounds.half_height_mm, bounds.half_height_mm);
}

void CArmPose::travel(const glm::dvec3& mm, const BodyBounds& bounds) {
  travel(mm.z, bounds);
  const glm::dvec2 farthest(bounds.radius_mm);
  across_mm = glm::clamp(across_mm + glm::dvec2(mm), -farthest, farthest);
}

void CArmPose::magnify(double times) { zoom = std::clamp(zoom * times, kMinZoom, kMaxZoom); }

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

View view_of(const CArmPose& pose, const BodyBounds& bounds, int width, int height) {
  View view{.lao_rad = pose.lao_rad,
            .cranial_rad = pose.cranial_rad,
            .cone = pose.cone,
            .centre_mm = bounds.centre_mm,
            .width = width,
            .height = height};
  // The magnification is that of the untilted picture: tilting does not change it.
  View untilted = view;
  untilted.cranial_rad = 0;
  view.pixel_mm = fitted(untilted, bounds).pixel_mm / pose.zoom;
  view.centre_mm += glm::dvec3(pose.across_mm, pose.table_mm);
  return fitted(view, bounds);
}

std::string status_of(const CArmPose& pose) {
  const View view{.lao_rad = pose.lao_rad, .cranial_rad = pose.cranial_rad};
  return fmt::format("{}   table {:+.0f} mm   x{:.2g}", label(view), pose.table_mm + 0.0, pose.zoom);
}

}  // namespace xraycast
