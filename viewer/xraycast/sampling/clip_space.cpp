#include "xraycast/sampling/clip_space.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace xraycast {

glm::dmat4 to_clip(const View& view) {
  const glm::dvec3 right = view.right() * (2 / (view.width * view.pixel_mm)),
                   up = view.up() * (2 / (view.height * view.pixel_mm)), n = view.towards_detector();
  const glm::dvec3 origin = view.cone ? view.source_mm() : view.centre_mm;
  // Row by row: clip = (row . p) + constant.
  struct Row {
    glm::dvec3 along;
    double constant;
  } x{}, y{}, z{}, w{};
  if (view.cone) {
    // Farther from the source is in front: z/w = a + b / distance, -1 at the farthest and 1 at the nearest.
    const double nearest = 0.05 * view.cone->source_axis_mm, farthest = view.cone->source_axis_mm + 3000;
    const double b = 2 / (1 / nearest - 1 / farthest), a = -1 - b / farthest;
    const double enlarged = view.cone->source_detector_mm;
    x = {enlarged * right, -enlarged * glm::dot(right, origin)};
    y = {enlarged * up, -enlarged * glm::dot(up, origin)};
    w = {n, -glm::dot(n, origin)};
    z = {a * n, a * w.constant + b};
  } else {
    constexpr double kReach_mm = 3000;
    x = {right, -glm::dot(right, origin)};
    y = {up, -glm::dot(up, origin)};
    z = {-n / kReach_mm, glm::dot(n, origin) / kReach_mm};
    w = {{}, 1};
  }
  glm::dmat4 matrix;
  const Row rows[] = {x, y, z, w};
  for (int i = 0; i < 4; ++i) {
    for (int axis = 0; axis < 3; ++axis) matrix[axis][i] = rows[i].along[axis];
    matrix[3][i] = rows[i].constant;
  }
  return matrix;
}

glm::dvec2 pixel_of(const View& view, const glm::dvec3& point_mm) {
  const glm::dvec4 clip = to_clip(view) * glm::dvec4(point_mm, 1);
  return {0.5 * (clip.x / clip.w + 1) * view.width, 0.5 * (1 - clip.y / clip.w) * view.height};
}

ScreenBox united(const ScreenBox& a, const ScreenBox& b) {
  if (a.width <= 0 || a.height <= 0) return b;
  if (b.width <= 0 || b.height <= 0) return a;
  const int x = std::min(a.x, b.x), y = std::min(a.y, b.y);
  return {x, y, std::max(a.x + a.width, b.x + b.width) - x, std::max(a.y + a.height, b.y + b.height) - y};
}

ScreenBox screen_box(const View& view, std::span<const glm::dvec3> corners_mm) {
  const glm::dmat4 matrix = to_clip(view);
  glm::dvec2 low(std::numeric_limits<double>::infinity()), high = -low;
  for (const glm::dvec3& corner : corners_mm) {
    const glm::dvec4 clip = matrix * glm::dvec4(corner, 1);
    constexpr double kBeside_mm = 1;  // of a cone's source; w of a parallel beam is 1
    if (view.cone && clip.w < kBeside_mm) return {0, 0, view.width, view.height};
    const glm::dvec2 pixel = 0.5 * (glm::dvec2(clip) / clip.w + 1.0) * glm::dvec2(view.width, view.height);
    low = glm::min(low, pixel);
    high = glm::max(high, pixel);
  }
  low = glm::clamp(glm::floor(low) - 1.0, glm::dvec2(0), glm::dvec2(view.width, view.height));
  high = glm::clamp(glm::ceil(high) + 1.0, glm::dvec2(0), glm::dvec2(view.width, view.height));
  if (!(low.x < high.x && low.y < high.y)) return {};
  const glm::ivec2 first(low), size(high - low);
  return {first.x, first.y, size.x, size.y};
}

std::array<glm::dvec3, 8> corners_mm(const BodyBounds& bounds, const View& view) {
  const glm::dvec3 across = bounds.radius_mm * view.right();
  const glm::dvec3 along = bounds.radius_mm * glm::dvec3(std::sin(view.lao_rad), -std::cos(view.lao_rad), 0);
  const glm::dvec3 up(0, 0, bounds.half_height_mm);
  std::array<glm::dvec3, 8> corners;
  for (int i = 0; i < 8; ++i)
    corners[i] =
        bounds.centre_mm + (i & 1 ? across : -across) + (i & 2 ? along : -along) + (i & 4 ? up : -up);
  return corners;
}

std::array<glm::dvec3, 8> corners_mm(const glm::dvec3& lower_mm, const glm::dvec3& upper_mm) {
  std::array<glm::dvec3, 8> corners;
  for (int i = 0; i < 8; ++i)
    corners[i] = {i & 1 ? upper_mm.x : lower_mm.x, i & 2 ? upper_mm.y : lower_mm.y,
                  i & 4 ? upper_mm.z : lower_mm.z};
  return corners;
}

}  // namespace xraycast
