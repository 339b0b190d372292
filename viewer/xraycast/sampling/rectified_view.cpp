#include "xraycast/sampling/rectified_view.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {
namespace {

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void intersect(const Range& other) {
    low = std::max(low, other.low);
    high = std::min(high, other.high);
  }
};

/// The view's ray through picture coordinates (a, b), counted in pixels from the upper left corner, as
/// homogeneous (x, z, w) on the upright plane: linear in a and b.
glm::dvec3 upright_point(const View& view, const RectifiedView& upright, double a, double b) {
  const glm::dvec3 on_detector = view.pixel_on_detector_mm(a - 0.5, b - 0.5);
  const glm::dvec3 right(upright.right, 0), forward(upright.forward, 0);
  if (!view.cone) {
    const glm::dvec3 offset = on_detector - view.centre_mm;
    return {glm::dot(offset, right), view.centre_mm.z + glm::dot(offset, view.up()) / std::cos(view.tilt_rad),
            1};
  }
  const glm::dvec3 ray = on_detector - view.source_mm();
  const double ahead = glm::dot(ray, forward);
  return {upright.source_mm * glm::dot(ray, right), upright.source_z_mm * ahead + upright.source_mm * ray.z,
          ahead};
}

/// Where a body's circle lies on the upright plane, seen along the rays.
Range body_columns_mm(const RectifiedView& upright, const BodyBounds& bounds) {
  const glm::dvec2 offset = glm::dvec2(bounds.centre_mm) - upright.centre_mm;
  const double across = glm::dot(offset, upright.right);
  if (!upright.is_cone()) return {across - bounds.radius_mm, across + bounds.radius_mm};
  const double ahead = upright.source_mm + glm::dot(offset, upright.forward);
  const double distance = std::hypot(across, ahead);
  if (distance <= bounds.radius_mm)
    return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  const double middle = std::atan2(across, ahead), half = std::asin(bounds.radius_mm / distance);
  const auto edge = [&](double angle, double beyond) {
    return std::abs(angle) < 0.49 * std::numbers::pi ? upright.source_mm * std::tan(angle) : beyond;
  };
  return {edge(middle - half, -std::numeric_limits<double>::infinity()),
          edge(middle + half, std::numeric_limits<double>::infinity())};
}

/// At which heights rays cross the plane that meet the body.
Range body_rows_mm(const RectifiedView& upright, const BodyBounds& bounds) {
  const double ahead = glm::dot(glm::dvec2(bounds.centre_mm) - upright.centre_mm, upright.forward);
  Range range;
  for (const double side : {-1.0, 1.0})
    for (const double end : {-1.0, 1.0}) {
      const double s = ahead + side * bounds.radius_mm;
      const double z = bounds.centre_mm.z + end * bounds.half_height_mm;
      if (!upright.is_cone()) {
        range.include(z - s * upright.slope);
      } else if (const double run = upright.source_mm + s; run > 0.02 * upright.source_mm) {
        // Columns to the side of the middle have longer runs, which stay between this and the plane.
        range.include(upright.source_z_mm + (z - upright.source_z_mm) * upright.source_mm / run);
      } else {
        return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
      }
    }
  return range;
}

void check_steepness(const View& view) {
  constexpr double kSteepest_rad = 80 * std::numbers::pi / 180;
  double steepest = std::abs(std::remainder(view.tilt_rad, 2 * std::numbers::pi));
  if (view.cone)
    steepest +=
        std::atan(0.5 * std::hypot(view.width, view.height) * view.pixel_mm / view.cone->source_detector_mm);
  if (steepest > kSteepest_rad)
    throw InputError("a tilt of {:g} deg looks along the map's axis; rays have to stay 10 deg away from it",
                     view.tilt_rad * 180 / std::numbers::pi);
}

}  // namespace

glm::dvec2 RectifiedView::direction(double column) const {
  return is_cone() ? glm::normalize(source_mm * forward + column_x_mm(column) * right) : forward;
}

double RectifiedView::slope_at(double column, double z_mm) const {
  return is_cone() ? (z_mm - source_z_mm) / std::hypot(source_mm, column_x_mm(column)) : slope;
}

glm::dvec2 RectifiedView::of_pixel(double i, double j) const {
  const glm::dvec3 place = from_pixel * glm::dvec3(i + 0.5, j + 0.5, 1);
  return glm::dvec2(place) / place.z;
}

RectifiedView rectified_view(const View& view, const MapGeometry& geometry, int pixels_per_column) {
  check_steepness(view);
  const BodyBounds bounds = bounds_of(geometry);
  RectifiedView upright{};
  upright.centre_mm = glm::dvec2(view.centre_mm);
  upright.right = glm::dvec2(view.right());
  upright.forward = {std::sin(view.angle_rad), -std::cos(view.angle_rad)};
  if (view.cone) {
    upright.source_mm = view.cone->source_axis_mm * std::cos(view.tilt_rad);
    upright.source_z_mm = view.source_mm().z;
  } else {
    upright.slope = std::tan(view.tilt_rad);
  }

  // What the picture shows of the plane, and what the body takes of that.
  const std::array<glm::dvec3, 3> basis{upright_point(view, upright, 0, 0),
                                        upright_point(view, upright, 1, 0),
                                        upright_point(view, upright, 0, 1)};
  const auto point = [&](double a, double b) {
    const glm::dvec3 p = basis[0] + a * (basis[1] - basis[0]) + b * (basis[2] - basis[0]);
    return glm::dvec2(p) / p.z;
  };
  Range x_mm, z_mm;
  for (const double a : {0.0, 1.0 * view.width})
    for (const double b : {0.0, 1.0 * view.height}) {
      x_mm.include(point(a, b).x);
      z_mm.include(point(a, b).y);
    }
  x_mm.intersect(body_columns_mm(upright, bounds));
  z_mm.intersect(body_rows_mm(upright, bounds));

  // Columns lie on the pixels' middles where those lie on the plane's.
  const glm::dvec2 middle = point(0.5 * view.width, 0.5 * view.height),
                   beside = point(0.5 * view.width + 1, 0.5 * view.height),
                   below = point(0.5 * view.width, 0.5 * view.height + 1);
  const double pixel_x_mm = beside.x - middle.x, pixel_z_mm = middle.y - below.y;
  upright.column_mm = pixel_x_mm * pixels_per_column;
  const double phase = middle.x + (view.width % 2 == 0 ? 0.5 : 0.0) * pixel_x_mm;
  const auto aligned = [&](double x) { return (x - phase) / upright.column_mm; };
  const double first_column = std::floor(aligned(x_mm.low)), last_column = std::ceil(aligned(x_mm.high));
  upright.left_mm = phase + first_column * upright.column_mm;

  // Rows: the map's own, or no coarser anywhere along a ray.
  if (!view.cone && upright.slope == 0) {
    upright.row_mm = geometry.row_spacing_mm;
    z_mm.intersect({geometry.z_mm(geometry.height - 1), geometry.z_mm(0)});
    const double first = std::max(0.0, std::floor((geometry.top_mm - z_mm.high) / upright.row_mm));
    upright.top_mm = geometry.z_mm(4 * std::floor(first / 4));
  } else {
    const double spread =
        view.cone ? 1 + (bounds.radius_mm + glm::distance(upright.centre_mm, glm::dvec2(bounds.centre_mm))) /
                            upright.source_mm
                  : 1;
    upright.row_mm = std::min(geometry.row_spacing_mm / spread, pixels_per_column * std::abs(pixel_z_mm));
    upright.top_mm = z_mm.high;
  }
  const double rows = std::ceil((upright.top_mm - z_mm.low) / upright.row_mm - 1e-9) + 1;
  constexpr double kMost = 1 << 24;  // more than any OpenGL draws into, which then says so
  if (x_mm.low < x_mm.high && z_mm.low <= z_mm.high) {
    upright.columns = static_cast<int>(std::clamp(last_column - first_column + 1, 0.0, kMost));
    upright.rows = static_cast<int>(std::clamp(rows, 0.0, kMost));
  }

  // (a, b, 1) -> (x, z, w) -> (column, row, w).
  const glm::dmat3 to_plane(basis[1] - basis[0], basis[2] - basis[0], basis[0]);
  const glm::dmat3 to_grid(1 / upright.column_mm, 0, 0,  //
                           0, -1 / upright.row_mm, 0,    //
                           -upright.left_mm / upright.column_mm, upright.top_mm / upright.row_mm, 1);
  upright.from_pixel = to_grid * to_plane;
  return upright;
}

}  // namespace xraycast
