#include "support/reference.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace xraycast::test {
namespace {

/// Length that two intervals share.
double overlap(double a0, double a1, double b0, double b1) {
  return std::max(0.0, std::min(a1, b1) - std::max(a0, b0));
}

/// The part of a line that lies in a body, in the line's own parameter; empty when enter >= leave.
struct Interval {
  double enter = -std::numeric_limits<double>::infinity(), leave = std::numeric_limits<double>::infinity();

  Interval within(const Interval& other) const {
    return {std::max(enter, other.enter), std::min(leave, other.leave)};
  }
  double length() const { return std::max(0.0, leave - enter); }
};
constexpr Interval kAll{}, kNone{1, 0};

/// Where lower <= origin + t * direction <= upper.
Interval slab(double origin, double direction, double lower, double upper) {
  if (direction == 0) return lower <= origin && origin <= upper ? kAll : kNone;
  const double t0 = (lower - origin) / direction, t1 = (upper - origin) / direction;
  return {std::min(t0, t1), std::max(t0, t1)};
}

Interval in_box(const glm::dvec3& origin_mm, const glm::dvec3& direction_mm, const Box& box) {
  return slab(origin_mm.x, direction_mm.x, box.lower_mm.x, box.upper_mm.x)
      .within(slab(origin_mm.y, direction_mm.y, box.lower_mm.y, box.upper_mm.y))
      .within(slab(origin_mm.z, direction_mm.z, box.lower_mm.z, box.upper_mm.z));
}

/// Where a t^2 + 2 b t + c <= 0, for a >= 0.
Interval parabola(double a, double b, double c) {
  if (a == 0) return c <= 0 ? kAll : kNone;  // the line does not move across the body
  const double discriminant = b * b - a * c;
  if (discriminant <= 0) return kNone;
  return {(-b - std::sqrt(discriminant)) / a, (-b + std::sqrt(discriminant)) / a};
}

/// The segment from a to b is its line's parameters 0 to 1.
double segment_chord(const glm::dvec3& a, const glm::dvec3& b, const Interval& body) {
  return body.within({0, 1}).length() * glm::distance(a, b);
}

/// `v` seen by a body that was turned about z.
glm::dvec3 turned_back(const glm::dvec3& v, double rotation_rad) {
  const double c = std::cos(rotation_rad), s = std::sin(rotation_rad);
  return {c * v.x + s * v.y, -s * v.x + c * v.y, v.z};
}

}  // namespace

// ---- procedural volumes

VolumeGeometry centred_geometry(const Index3& size, const glm::dvec3& spacing_mm) {
  return {size, spacing_mm, -0.5 * spacing_mm * glm::dvec3(size - Index3(1))};
}

Volume make_volume(const Index3& size, const glm::dvec3& spacing_mm,
                   const std::function<double(const glm::dvec3& world_mm)>& hu) {
  Volume volume(centred_geometry(size, spacing_mm));
  for (std::int64_t z = 0; z < size.z; ++z)
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x)
        volume.at(x, y, z) = static_cast<std::int16_t>(
            std::clamp(std::round(hu(volume.geometry().to_world_mm({x, y, z}))), -1024.0, 32767.0));
  return volume;
}

Volume textured_volume(const Index3& size, const glm::dvec3& spacing_mm) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-60, 60);
  return make_volume(size, spacing_mm, [&](const glm::dvec3& p) {
    return -200 + 500 * std::sin(p.x / 9) * std::cos(p.y / 7 + p.z) + 8 * p.x - 3 * p.y + noise(random);
  });
}

bool Box::contains(const glm::dvec3& point_mm) const {
  return glm::clamp(point_mm, lower_mm, upper_mm) == point_mm;
}

std::vector<Box> random_boxes(int count, const Box& bounds, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto place_mm = [&] {
    const double x = unit(random), y = unit(random), z = unit(random);
    return glm::mix(bounds.lower_mm, bounds.upper_mm, glm::dvec3(x, y, z));
  };
  std::vector<Box> boxes;
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 one_mm = place_mm(), other_mm = place_mm();
    boxes.push_back({glm::min(one_mm, other_mm), glm::max(one_mm, other_mm)});
  }
  return boxes;
}

// ---- sampling

double sample_hu(const Volume& volume, double x_index, double y_index, std::int64_t z) {
  const Index3& size = volume.geometry().size;
  const bool inside = x_index >= -0.5 && x_index <= static_cast<double>(size.x) - 0.5 && y_index >= -0.5 &&
                      y_index <= static_cast<double>(size.y) - 0.5;
  return inside ? sample_hu(volume, {x_index, y_index, static_cast<double>(z)}) : kPaddingHu;
}

double sample_hu(const Volume& volume, const glm::dvec3& index) {
  const glm::dvec3 last(volume.geometry().size - Index3(1));
  const glm::dvec3 held = glm::clamp(index, glm::dvec3(0), last), lower = glm::floor(held);
  const Index3 a(lower), b(glm::min(lower + 1.0, last));
  const glm::dvec3 f = held - lower;
  const auto row = [&](std::int64_t y, std::int64_t z) {
    return std::lerp(volume.at(a.x, y, z), volume.at(b.x, y, z), f.x);
  };
  return std::lerp(std::lerp(row(a.y, a.z), row(b.y, a.z), f.y), std::lerp(row(a.y, b.z), row(b.y, b.z), f.y),
                   f.z);
}

Box scan_extent(const VolumeGeometry& geometry) {
  return {geometry.to_world_mm(glm::dvec3(-0.5)), geometry.to_world_mm(glm::dvec3(geometry.size) - 0.5)};
}

// ---- maps and projections

glm::dvec2 radial_direction(double phi_rad) { return {std::sin(phi_rad), -std::cos(phi_rad)}; }

double column_phi_rad(int column, int angles) { return (column + 0.5) * 2 * std::numbers::pi / angles; }

std::vector<double> reference_cylinder_map(const Volume& volume, std::span<const glm::dvec2> centre_mm,
                                           std::span<const double> radii_mm, int angles, double step_mm,
                                           const MuOfHu& mu) {
  const VolumeGeometry& geometry = volume.geometry();
  const auto rows = static_cast<std::size_t>(geometry.size.z), columns = static_cast<std::size_t>(angles);
  const std::size_t layers = radii_mm.size() - 1;
  assert(centre_mm.size() == rows);
  std::vector<double> map(layers * rows * columns, 0.0);

  for (std::size_t row = 0; row < rows; ++row) {
    const std::int64_t z = geometry.size.z - 1 - static_cast<std::int64_t>(row);
    for (std::size_t column = 0; column < columns; ++column) {
      const glm::dvec2 direction = radial_direction(column_phi_rad(static_cast<int>(column), angles));
      for (int i = 0; i * step_mm < radii_mm.back(); ++i) {
        const glm::dvec2 point_mm = centre_mm[row] + (i + 0.5) * step_mm * direction;
        const glm::dvec3 index = geometry.to_index({point_mm, 0});
        const double mu_per_mm = mu(sample_hu(volume, index.x, index.y, z));
        for (std::size_t layer = 0; layer < layers; ++layer)
          map[(layer * rows + row) * columns + column] +=
              mu_per_mm * overlap(i * step_mm, (i + 1) * step_mm, radii_mm[layer], radii_mm[layer + 1]);
      }
    }
  }
  return map;
}

double reference_joseph(const Volume& volume, const glm::dvec3& source_mm, const glm::dvec3& end_mm,
                        const MuOfHu& mu) {
  const VolumeGeometry& geometry = volume.geometry();
  const glm::dvec3 source = geometry.to_index(source_mm), direction = geometry.to_index(end_mm) - source;
  const glm::dvec3 extent = glm::abs(direction);
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  if (extent[axis] == 0) return 0;  // source and end coincide

  const Interval line = in_box(source_mm, end_mm - source_mm, scan_extent(geometry)).within({0, 1});
  if (line.length() == 0) return 0;
  const double one = source[axis] + line.enter * direction[axis],
               other = source[axis] + line.leave * direction[axis];
  const double first = std::min(one, other), last = std::max(one, other);
  const double plane_mm =
      glm::distance(source_mm, end_mm) / extent[axis];  // along the ray, from plane to plane
  double tau = 0;
  for (std::int64_t k = 0; k < geometry.size[axis]; ++k) {
    const auto plane = static_cast<double>(k);
    const double share = overlap(plane - 0.5, plane + 0.5, first, last);
    if (share == 0) continue;
    glm::dvec3 index = source + (plane - source[axis]) / direction[axis] * direction;
    index[axis] = plane;  // exactly, so that trilinear is bilinear in the plane
    tau += mu(sample_hu(volume, index)) * share * plane_mm;
  }
  return tau;
}

double reference_line_integral(const std::function<double(const glm::dvec3& world_mm)>& mu_at,
                               const glm::dvec3& a_mm, const glm::dvec3& b_mm, double step_mm) {
  const double length_mm = glm::distance(a_mm, b_mm);
  const auto steps = static_cast<std::int64_t>(std::ceil(length_mm / step_mm));
  double sum = 0;
  for (std::int64_t i = 0; i < steps; ++i)
    sum += mu_at(glm::mix(a_mm, b_mm, (static_cast<double>(i) + 0.5) / static_cast<double>(steps)));
  return steps == 0 ? 0 : sum * length_mm / static_cast<double>(steps);
}

// ---- closed forms

double box_chord_mm(const glm::dvec3& a_mm, const glm::dvec3& b_mm, const Box& box) {
  return segment_chord(a_mm, b_mm, in_box(a_mm, b_mm - a_mm, box));
}

bool Ellipsoid::contains(const glm::dvec3& point_mm) const {
  const glm::dvec3 unit = turned_back(point_mm - centre_mm, rotation_rad) / radii_mm;
  return glm::dot(unit, unit) <= 1;
}

double ellipsoid_chord_mm(const glm::dvec3& a_mm, const glm::dvec3& b_mm, const Ellipsoid& ellipsoid) {
  // In the space where the ellipsoid is the unit sphere; line parameters stay the same.
  const glm::dvec3 a = turned_back(a_mm - ellipsoid.centre_mm, ellipsoid.rotation_rad) / ellipsoid.radii_mm;
  const glm::dvec3 d = turned_back(b_mm - a_mm, ellipsoid.rotation_rad) / ellipsoid.radii_mm;
  return segment_chord(a_mm, b_mm, parabola(glm::dot(d, d), glm::dot(a, d), glm::dot(a, a) - 1));
}

double ellipsoids_line_integral(const glm::dvec3& a_mm, const glm::dvec3& b_mm,
                                std::span<const Ellipsoid> ellipsoids) {
  double tau = 0;
  for (const Ellipsoid& ellipsoid : ellipsoids)
    tau += ellipsoid.mu_per_mm * ellipsoid_chord_mm(a_mm, b_mm, ellipsoid);
  return tau;
}

double cylinder_chord_mm(const glm::dvec3& a_mm, const glm::dvec3& b_mm, const Cylinder& cylinder) {
  const glm::dvec2 a = glm::dvec2(a_mm) - cylinder.centre_mm, d = glm::dvec2(b_mm) - glm::dvec2(a_mm);
  const Interval wall =
      parabola(glm::dot(d, d), glm::dot(a, d), glm::dot(a, a) - cylinder.radius_mm * cylinder.radius_mm);
  return segment_chord(a_mm, b_mm,
                       wall.within(slab(a_mm.z, b_mm.z - a_mm.z, cylinder.lower_z_mm, cylinder.upper_z_mm)));
}

double radial_circle_chord_mm(const glm::dvec2& axis_mm, double phi_rad, double inner_mm, double outer_mm,
                              const glm::dvec2& circle_mm, double radius_mm) {
  const glm::dvec2 offset = axis_mm - circle_mm;
  return parabola(1, glm::dot(offset, radial_direction(phi_rad)),
                  glm::dot(offset, offset) - radius_mm * radius_mm)
      .within({inner_mm, outer_mm})
      .length();
}

double radial_box_chord_mm(const glm::dvec2& axis_mm, double phi_rad, double inner_mm, double outer_mm,
                           const glm::dvec2& lower_mm, const glm::dvec2& upper_mm) {
  const glm::dvec2 direction = radial_direction(phi_rad);
  return slab(axis_mm.x, direction.x, lower_mm.x, upper_mm.x)
      .within(slab(axis_mm.y, direction.y, lower_mm.y, upper_mm.y))
      .within({inner_mm, outer_mm})
      .length();
}

}  // namespace xraycast::test
