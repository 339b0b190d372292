#include "xraycast/sampling/rectified_view.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

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

/// The part of the rectified plane, along its rows, that the body's circle is projected to.
Range body_columns_mm(const RectifiedView& rectified, const BodyBounds& bounds) {
  const glm::dvec2 offset = glm::dvec2(bounds.centre_mm) - rectified.centre_mm;
  const double across = glm::dot(offset, rectified.right);
  if (!rectified.is_cone()) return {across - bounds.radius_mm, across + bounds.radius_mm};
  const double ahead = rectified.source_mm + glm::dot(offset, rectified.forward);
  const double distance = std::hypot(across, ahead);
  if (distance <= bounds.radius_mm)
    return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  const double middle = std::atan2(across, ahead), half = std::asin(bounds.radius_mm / distance);
  const auto edge = [&](double angle, double beyond) {
    return std::abs(angle) < 0.49 * std::numbers::pi ? rectified.source_mm * std::tan(angle) : beyond;
  };
  return {edge(middle - half, -std::numeric_limits<double>::infinity()),
          edge(middle + half, std::numeric_limits<double>::infinity())};
}

/// The heights at which the rays that meet the body cross the plane.
Range body_rows_mm(const RectifiedView& rectified, const BodyBounds& bounds) {
  const double ahead = glm::dot(glm::dvec2(bounds.centre_mm) - rectified.centre_mm, rectified.forward);
  Range range;
  for (const double side : {-1.0, 1.0})
    for (const double end : {-1.0, 1.0}) {
      const double s = ahead + side * bounds.radius_mm;
      const double z = bounds.centre_mm.z + end * bounds.half_height_mm;
      if (!rectified.is_cone()) {
        range.include(z - s * rectified.slope);
      } else if (const double run = rectified.source_mm + s; run > 0.02 * rectified.source_mm) {
        // Columns beside the middle have longer runs, whose heights lie between this one and the plane's.
        range.include(rectified.source_z_mm + (z - rectified.source_z_mm) * rectified.source_mm / run);
      } else {
        return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
      }
    }
  return range;
}

/// How far the rays to the picture's corners are from the one to its middle.
double opening_rad(const View& view) {
  const double corner_mm = 0.5 * std::hypot(view.width, view.height) * view.pixel_mm;
  return view.cone ? std::atan(corner_mm / view.cone->source_detector_mm) : 0;
}

/// Names what makes the rays steep: the picture's size over its distance, the tilt, or both.
void check_steepness(const View& view) {
  constexpr double kDegrees = 180 / std::numbers::pi, kSteepest_deg = 80;
  const double tilt_deg = view.cranial_rad * kDegrees, opening_deg = opening_rad(view) * kDegrees;
  const double steep_deg = std::abs(std::remainder(tilt_deg, 360));
  if (steep_deg + opening_deg <= kSteepest_deg) return;
  if (opening_deg > kSteepest_deg)
    throw InputError(
        "a picture of {:.0f} x {:.0f} mm is too large for a detector {:g} mm from the source: rays to its "
        "corners are {:.1f} deg from the one to its middle, and must be within {:g} deg; place source "
        "and detector farther from the body, or make the picture smaller",
        view.width * view.pixel_mm, view.height * view.pixel_mm, view.cone->source_detector_mm, opening_deg,
        kSteepest_deg);
  const std::string where =
      steep_deg > kSteepest_deg
          ? ""
          : fmt::format(" in the picture's corners, whose rays are {:.1f} deg from the one to its middle",
                        opening_deg);
  throw InputError("a tilt of {:g} deg looks along the map's axis{}; rays must be at least {:g} deg from it",
                   tilt_deg, where, 90 - kSteepest_deg);
}

/// The plane through the view's centre, and the rays that cross it; without columns and rows yet.
RectifiedView plane_of(const View& view) {
  RectifiedView plane{};
  plane.centre_mm = glm::dvec2(view.centre_mm);
  plane.right = glm::dvec2(view.right());
  plane.forward = {std::sin(view.lao_rad), -std::cos(view.lao_rad)};
  if (view.cone) {
    plane.source_mm = view.cone->source_axis_mm * std::cos(view.cranial_rad);
    plane.source_z_mm = view.source_mm().z;
  } else {
    plane.slope = std::tan(view.cranial_rad);
  }
  return plane;
}

/// The homography from the view's pixels, counted from the upper left corner, to (x, z) on the plane.
class Homography {
 public:
  Homography(const View& view, const RectifiedView& plane) {
    const glm::dvec3 origin = image_of(view, plane, 0, 0);
    matrix_ = {image_of(view, plane, 1, 0) - origin, image_of(view, plane, 0, 1) - origin, origin};
  }

  glm::dvec2 at(double a, double b) const {
    const glm::dvec3 p = matrix_[2] + a * matrix_[0] + b * matrix_[1];
    return glm::dvec2(p) / p.z;
  }
  const glm::dmat3& matrix() const { return matrix_; }

 private:
  /// Where the ray through a pixel crosses the plane, as homogeneous (x, z, w): linear in a and b.
  static glm::dvec3 image_of(const View& view, const RectifiedView& plane, double a, double b) {
    const glm::dvec3 on_detector = view.pixel_on_detector_mm(a - 0.5, b - 0.5);
    const glm::dvec3 right(plane.right, 0), forward(plane.forward, 0);
    if (!view.cone) {
      const glm::dvec3 offset = on_detector - view.centre_mm;
      return {glm::dot(offset, right),
              view.centre_mm.z + glm::dot(offset, view.up()) / std::cos(view.cranial_rad), 1};
    }
    const glm::dvec3 ray = on_detector - view.source_mm();
    const double ahead = glm::dot(ray, forward);
    return {plane.source_mm * glm::dot(ray, right), plane.source_z_mm * ahead + plane.source_mm * ray.z,
            ahead};
  }

  glm::dmat3 matrix_{1};
};

/// The part of the plane that the picture shows, and the body's part of that.
struct VisibleBody {
  Range x_mm, z_mm;
  bool is_seen() const { return x_mm.low < x_mm.high && z_mm.low <= z_mm.high; }
};

VisibleBody visible_body(const View& view, const RectifiedView& plane, const Homography& to_plane,
                         const BodyBounds& bounds) {
  VisibleBody body;
  for (const double a : {0.0, 1.0 * view.width})
    for (const double b : {0.0, 1.0 * view.height}) {
      const glm::dvec2 corner = to_plane.at(a, b);
      body.x_mm.include(corner.x);
      body.z_mm.include(corner.y);
    }
  body.x_mm.intersect(body_columns_mm(plane, bounds));
  body.z_mm.intersect(body_rows_mm(plane, bounds));
  return body;
}

/// The pixels' size in the middle of the plane.
glm::dvec2 pixel_mm(const View& view, const Homography& to_plane) {
  const double a = 0.5 * view.width, b = 0.5 * view.height;
  const glm::dvec2 middle = to_plane.at(a, b);
  return {to_plane.at(a + 1, b).x - middle.x, middle.y - to_plane.at(a, b + 1).y};
}

constexpr double kMaxSize = 1 << 24;  // more than any OpenGL draws into, which then says so

/// Columns that pass through the pixels' centres where the plane is parallel to the detector.
void set_columns(RectifiedView& rectified, const View& view, const Homography& to_plane,
                 const VisibleBody& body, double pixels_per_column) {
  const double pixel_x_mm = pixel_mm(view, to_plane).x;
  rectified.column_mm = pixel_x_mm * pixels_per_column;
  const double phase =
      to_plane.at(0.5 * view.width, 0.5 * view.height).x + (view.width % 2 == 0 ? 0.5 : 0.0) * pixel_x_mm;
  const auto column_at = [&](double x) { return (x - phase) / rectified.column_mm; };
  const double first = std::floor(column_at(body.x_mm.low)), last = std::ceil(column_at(body.x_mm.high));
  rectified.left_mm = phase + first * rectified.column_mm;
  if (body.is_seen()) rectified.columns = static_cast<int>(std::clamp(last - first + 1, 0.0, kMaxSize));
}

/// The map's own rows for untilted parallel views; otherwise rows that are no coarser anywhere along a ray.
void set_rows(RectifiedView& rectified, const View& view, const Homography& to_plane,
              const MapGeometry& geometry, VisibleBody body, double pixels_per_column) {
  if (!view.cone && rectified.slope == 0) {
    rectified.row_mm = geometry.row_spacing_mm;
    body.z_mm.intersect({geometry.z_mm(geometry.height - 1), geometry.z_mm(0)});
    const double first = std::max(0.0, std::floor((geometry.top_mm - body.z_mm.high) / rectified.row_mm));
    rectified.top_mm = geometry.z_mm(4 * std::floor(first / 4));
  } else {
    const BodyBounds bounds = bounds_of(geometry);
    const double spread =
        view.cone
            ? 1 + (bounds.radius_mm + glm::distance(rectified.centre_mm, glm::dvec2(bounds.centre_mm))) /
                      rectified.source_mm
            : 1;
    rectified.row_mm =
        std::min(geometry.row_spacing_mm / spread, pixels_per_column * std::abs(pixel_mm(view, to_plane).y));
    rectified.top_mm = body.z_mm.high;
  }
  const double rows = std::ceil((rectified.top_mm - body.z_mm.low) / rectified.row_mm - 1e-9) + 1;
  if (body.is_seen()) rectified.rows = static_cast<int>(std::clamp(rows, 0.0, kMaxSize));
}

/// Whether it is no larger than what OpenGL draws into at once, of which a texel holds four rows.
bool is_drawable(const RectifiedView& rectified) {
  constexpr int kLargestTarget = 16384;  // of Mesa, and of most GPUs
  return rectified.columns <= kLargestTarget && rectified.rows <= 4 * kLargestTarget;
}

/// From (x, z, w) on the plane to (column, row, w).
glm::dmat3 to_grid(const RectifiedView& rectified) {
  return glm::dmat3(1 / rectified.column_mm, 0, 0,  //
                    0, -1 / rectified.row_mm, 0,    //
                    -rectified.left_mm / rectified.column_mm, rectified.top_mm / rectified.row_mm, 1);
}

}  // namespace

glm::dvec2 RectifiedView::direction(double column) const {
  return is_cone() ? glm::normalize(source_mm * forward + column_x_mm(column) * right) : forward;
}

RectifiedView rectified_view(const View& view, const MapGeometry& geometry, int pixels_per_column) {
  check_steepness(view);
  RectifiedView rectified = plane_of(view);
  const Homography to_plane(view, rectified);
  const VisibleBody body = visible_body(view, rectified, to_plane, bounds_of(geometry));
  const auto set_grid = [&](double pixels_apart) {
    set_columns(rectified, view, to_plane, body, pixels_apart);
    set_rows(rectified, view, to_plane, geometry, body, pixels_apart);
  };
  // Where pixels lie between columns, as under a cone or a tilt, full resolution takes twice as many: columns
  // as far apart as pixels would blur when interpolated.
  const bool lie_between = view.cone || rectified.slope != 0;
  const bool doubles = lie_between && pixels_per_column == kFullResolution;
  set_grid(doubles ? 0.5 : pixels_per_column);
  if (doubles && !is_drawable(rectified)) set_grid(pixels_per_column);
  rectified.from_pixel = to_grid(rectified) * to_plane.matrix();
  return rectified;
}

}  // namespace xraycast
