#include "xraycast/scene/thin_tube.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

/// Of a view's pixels in the plane of the farthest corner from a cone's source.
double largest_pixel_mm(const View& view, const glm::dvec3& lower_mm, const glm::dvec3& upper_mm) {
  if (!view.cone) return view.pixel_mm;
  double farthest_mm = 0;
  for (const glm::dvec3& corner_mm : corners_mm(lower_mm, upper_mm))
    farthest_mm = std::max(farthest_mm, glm::dot(corner_mm - view.source_mm(), view.towards_detector()));
  return view.pixel_mm * std::min(1.0, farthest_mm / view.cone->source_detector_mm);
}

}  // namespace

Tube tube_of(const Surface& surface) {
  if (surface.tube_sides == 0) return {};
  const std::vector<glm::vec3>& points_mm = surface.mesh.points_mm;
  Tube tube{surface.tube_sides, 0, std::vector(points_mm.size(), glm::vec3(0))};
  const auto sides = static_cast<std::size_t>(tube.sides);
  for (std::size_t ring = 1; ring + sides < points_mm.size(); ring += sides) {
    glm::dvec3 sum(0);
    for (std::size_t i = ring; i < ring + sides; ++i) sum += glm::dvec3(points_mm[i]);
    const glm::dvec3 middle_mm = sum / static_cast<double>(sides);
    for (std::size_t i = ring; i < ring + sides; ++i)
      tube.from_axis_mm[i] = glm::vec3(glm::dvec3(points_mm[i]) - middle_mm);
    // Rings of round ends are smaller.
    tube.radius_mm = std::max(tube.radius_mm, double(glm::length(tube.from_axis_mm[ring])));
  }
  return tube;
}

Widening widening_of(const Tube& tube, const glm::dvec3& lower_mm, const glm::dvec3& upper_mm,
                     const View& view) {
  if (tube.radius_mm <= 0) return {};
  const double least_mm = kLeastRadius_pixels * largest_pixel_mm(view, lower_mm, upper_mm);
  const double radii = tube.radius_mm / least_mm, factor = std::max(1.0, 1 / radii);
  const double thinness = std::clamp(2 - radii, 0.0, 1.0);
  // The matter is a circle's and the drawn tube's section a polygon, an octagon a tenth smaller: thin tubes
  // get that back.
  const double polygon = 0.5 * tube.sides * std::sin(2 * std::numbers::pi / tube.sides);
  const double density = std::lerp(1.0, std::numbers::pi / polygon, thinness);
  return {factor, thinness, density / (factor * factor)};
}

std::vector<glm::vec3> widened(const std::vector<glm::vec3>& points_mm, const Tube& tube,
                               const Widening& widening) {
  std::vector<glm::vec3> drawn_mm = points_mm;
  const auto further = static_cast<float>(widening.factor - 1);
  for (std::size_t i = 0; i < tube.from_axis_mm.size(); ++i) drawn_mm[i] += further * tube.from_axis_mm[i];
  return drawn_mm;
}

ScreenBox drawn_box(const Tube& tube, const glm::dvec3& lower_mm, const glm::dvec3& upper_mm,
                    const View& view) {
  const Widening widening = widening_of(tube, lower_mm, upper_mm, view);
  const double wider_mm = (widening.factor - 1) * tube.radius_mm;
  return screen_box(view, corners_mm(lower_mm - wider_mm, upper_mm + wider_mm));
}

}  // namespace xraycast
