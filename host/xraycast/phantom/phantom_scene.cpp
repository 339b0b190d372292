#include "xraycast/phantom/phantom_scene.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

static_assert(sizeof(XrcPrimitive) == 26 * 4);
static_assert(sizeof(XrcStation) == 4 * 4);

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr double kTiny = 1e-12;
constexpr double kStationStep_mm = 2;  // finer than the eye sees a straight piece in a section's outline

void store(float (&to)[3], const glm::dvec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(from[i]);
}

glm::dvec3 load(const float (&from)[3]) { return {from[0], from[1], from[2]}; }

/// The length of (u, v), both at least 0, in the n-norm.
double norm(double u, double v, double n) {
  return n == 2 ? std::hypot(u, v) : std::pow(std::pow(u, n) + std::pow(v, n), 1 / n);
}

/// The derivative of the n-norm by a component that is `share` of it.
double norm_slope(double share, double n) { return std::pow(share, n - 1); }

glm::dvec3 octant(const XrcPrimitive& s, const glm::dvec3& p) {
  const glm::dvec3 b = load(s.b), c = load(s.c), q = p - load(s.a);
  return glm::abs(glm::dvec3(glm::dot(q, b), glm::dot(q, c), glm::dot(q, glm::cross(b, c))));
}

// f = ||(||(x/a, y/b)||, z/c)|| is 1 on the surface; (f - 1) / |grad f| is the distance to first order.
double solid_distance(const XrcPrimitive& s, const glm::dvec3& p) {
  const glm::dvec3 size = load(s.size), q = octant(s, p) / size;
  const double n = s.exponents[0], m = s.exponents[1];
  const double g = std::max(norm(q.x, q.y, n), kTiny), f = std::max(norm(g, q.z, m), kTiny);
  const glm::dvec3 slope = glm::dvec3(norm_slope(g / f, m) * norm_slope(q.x / g, n),
                                      norm_slope(g / f, m) * norm_slope(q.y / g, n), norm_slope(q.z / f, m)) /
                           size;
  return (f - 1) / std::max(glm::length(slope), kTiny);
}

double box_distance(const XrcPrimitive& s, const glm::dvec3& p) {
  const glm::dvec3 q = octant(s, p) - load(s.size);
  return glm::length(glm::max(q, 0.0)) + std::min(std::max({q.x, q.y, q.z}), 0.0);
}

glm::dvec3 stretch(const glm::dvec3& v, const glm::dvec3& axis, double factor) {
  return v + (factor - 1) * glm::dot(v, axis) * axis;
}

// A flattened capsule is a round one in a space stretched along the flat axis.
double capsule_distance(const XrcPrimitive& s, const glm::dvec3& p) {
  const glm::dvec3 axis = load(s.c), a = load(s.a);
  const glm::dvec3 ab = stretch(load(s.b) - a, axis, s.size[2]), ap = stretch(p - a, axis, s.size[2]);
  const double t = std::clamp(glm::dot(ap, ab) / std::max(glm::dot(ab, ab), kTiny), 0.0, 1.0);
  const glm::dvec3 outwards = ap - t * ab;
  const double from_axis = std::max(glm::length(outwards), kTiny);
  const glm::dvec3 slope = stretch(outwards / from_axis, axis, s.size[2]);
  return (from_axis - glm::mix<double>(s.size[0], s.size[1], t)) / std::max(glm::length(slope), kTiny);
}

double squared(const glm::dvec3& v) { return glm::dot(v, v); }

double squared_to_edge(const glm::dvec3& edge, const glm::dvec3& v) {
  return squared(v - edge * std::clamp(glm::dot(v, edge) / std::max(squared(edge), kTiny), 0.0, 1.0));
}

double plate_distance(const XrcPrimitive& s, const glm::dvec3& p) {
  const glm::dvec3 a = load(s.a), b = load(s.b), c = load(s.c), normal = glm::cross(b - a, a - c);
  const bool is_above_face = glm::dot(glm::cross(b - a, normal), p - a) >= 0 &&
                             glm::dot(glm::cross(c - b, normal), p - b) >= 0 &&
                             glm::dot(glm::cross(a - c, normal), p - c) >= 0;
  if (is_above_face) return std::abs(glm::dot(normal, p - a)) / glm::length(normal) - s.size[0];
  return std::sqrt(std::min(
             {squared_to_edge(b - a, p - a), squared_to_edge(c - b, p - b), squared_to_edge(a - c, p - c)})) -
         s.size[0];
}

// As for a solid, in the section at the height of p; the slope along z is that of the section's centre and
// axes. Flat at both ends.
double loft_distance(const XrcPrimitive& s, std::span<const XrcStation> stations, const glm::dvec3& p) {
  const double last = s.count - 1, n = s.exponents[0], up = (p.z - s.a[0]) / s.a[1];
  const double beyond_end_mm = std::max(-up, up - last) * s.a[1], height = std::clamp(up, 0.0, last);
  const int i = std::min(static_cast<int>(height), s.count - 2);
  const XrcStation &low = stations[s.first + i], &high = stations[s.first + i + 1];
  const glm::dvec4 lower(low.x, low.y, low.a, low.b), upper(high.x, high.y, high.a, high.b);
  const glm::dvec4 here = glm::mix(lower, upper, height - i),
                   rise = (upper - lower) / static_cast<double>(s.a[1]);
  const glm::dvec2 from_centre(p.x - here.x, p.y - here.y), axes(here.z, here.w),
      q = glm::abs(from_centre) / axes;
  const double f = std::max(norm(q.x, q.y, n), kTiny);
  const glm::dvec2 slope = glm::dvec2(norm_slope(q.x / f, n), norm_slope(q.y / f, n)) / axes;
  const double slope_z =
      glm::dot(slope, glm::sign(from_centre) * glm::dvec2(rise.x, rise.y) + q * glm::dvec2(rise.z, rise.w));
  return std::max((f - 1) / std::max(glm::length(glm::dvec3(slope, slope_z)), kTiny), beyond_end_mm);
}

/// Half the extent along x, y and z of an ellipsoid; of a box when `is_box`.
glm::dvec3 half_extent(const glm::dvec3& size, const ShapeAxes& axes, bool is_box) {
  const glm::dvec3 u = axes.u * size.x, v = axes.v * size.y, w = glm::cross(axes.u, axes.v) * size.z;
  return is_box ? glm::abs(u) + glm::abs(v) + glm::abs(w) : glm::sqrt(u * u + v * v + w * w);
}

/// Value at `at`, between x[1] and x[2], of the cubic with Catmull-Rom slopes through the points (x, y).
double hermite(const glm::dvec4& x, const glm::dvec4& y, double at) {
  const double h = x[2] - x[1], t = (at - x[1]) / h;
  const double m1 = (y[2] - y[0]) / (x[2] - x[0]) * h, m2 = (y[3] - y[1]) / (x[3] - x[1]) * h;
  return (2 * t * t * t - 3 * t * t + 1) * y[1] + (t * t * t - 2 * t * t + t) * m1 +
         (3 * t * t - 2 * t * t * t) * y[2] + (t * t * t - t * t) * m2;
}

}  // namespace

ShapeAxes axes_along(const glm::dvec3& w) {
  const glm::dvec3 unit = glm::normalize(w);
  const glm::dvec3 hint = std::abs(unit.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 u = glm::normalize(hint - glm::dot(hint, unit) * unit);
  return {u, glm::cross(unit, u)};
}

// ---- lofts ----------------------------------------------------------------------------------------

Loft::Section Loft::at(double z_mm) const {
  const double z = std::clamp(z_mm, sections.front().z_mm, sections.back().z_mm);
  const auto above = std::ranges::upper_bound(sections, z, {}, &Section::z_mm);
  const auto last = static_cast<std::ptrdiff_t>(sections.size()) - 1;
  const std::ptrdiff_t i = std::clamp<std::ptrdiff_t>(above - sections.begin() - 1, 0, last - 1);
  // Beyond an end the curve goes on as it was, so that the slope there is that of the last piece.
  const auto component = [&](double Section::*member) {
    const auto value = [&](std::ptrdiff_t k) { return sections[static_cast<std::size_t>(k)].*member; };
    const double before = i > 0 ? value(i - 1) : 2 * value(0) - value(1);
    const double after = i + 2 <= last ? value(i + 2) : 2 * value(last) - value(last - 1);
    return glm::dvec4(before, value(i), value(i + 1), after);
  };
  const glm::dvec4 heights = component(&Section::z_mm);
  return {z_mm, hermite(heights, component(&Section::x_mm), z),
          hermite(heights, component(&Section::y_mm), z), hermite(heights, component(&Section::a_mm), z),
          hermite(heights, component(&Section::b_mm), z)};
}

glm::dvec3 Loft::surface(double z_mm, double angle_rad, double side) const {
  const Section s = at(z_mm);
  const double sine = std::sin(angle_rad), cosine = std::cos(angle_rad);
  return {s.x_mm + side * s.a_mm * std::pow(std::abs(sine), 2 / exponent),
          s.y_mm + std::copysign(s.b_mm * std::pow(std::abs(cosine), 2 / exponent), cosine), z_mm};
}

Loft Loft::inset(double dx_mm, double dy_mm) const {
  Loft inner = *this;
  for (Section& section : inner.sections) {
    section.a_mm -= dx_mm;
    section.b_mm -= dy_mm;
  }
  return inner;
}

Loft Loft::between(double bottom_mm, double top_mm) const {
  Loft part{{}, exponent};
  const int pieces = std::max(3, static_cast<int>(std::ceil((top_mm - bottom_mm) / kStationStep_mm)));
  for (int i = 0; i <= pieces; ++i)
    part.sections.push_back(at(glm::mix(bottom_mm, top_mm, static_cast<double>(i) / pieces)));
  return part;
}

// ---- building -------------------------------------------------------------------------------------

void PhantomScene::begin_layer(double hu, bool is_additive, std::string_view part) {
  ++layer_;
  parts_.emplace_back(part);
  layer_hu_ = hu;
  layer_is_additive_ = is_additive;
}

XrcPrimitive& PhantomScene::append(int kind, const Box& bounds) {
  assert(layer_ > 0);  // paint() or add() comes first
  XrcPrimitive shape{};
  shape.kind = kind;
  shape.layer = layer_;
  shape.is_additive = layer_is_additive_;
  shape.hu = static_cast<float>(layer_hu_);
  store(shape.lower_mm, bounds.lower_mm);
  store(shape.upper_mm, bounds.upper_mm);
  return primitives_.emplace_back(shape);
}

void PhantomScene::ellipsoid(const glm::dvec3& centre, const glm::dvec3& half_axes, const ShapeAxes& axes) {
  superellipsoid(centre, half_axes, 2, 2, axes);
}

void PhantomScene::superellipsoid(const glm::dvec3& centre, const glm::dvec3& half_axes, double section,
                                  double height, const ShapeAxes& axes) {
  const glm::dvec3 half = half_extent(half_axes, axes, section > 2 || height > 2);
  XrcPrimitive& shape = append(XRC_SOLID, {centre - half, centre + half});
  store(shape.a, centre);
  store(shape.b, axes.u);
  store(shape.c, axes.v);
  store(shape.size, half_axes);
  shape.exponents[0] = static_cast<float>(section);
  shape.exponents[1] = static_cast<float>(height);
}

void PhantomScene::box(const glm::dvec3& centre, const glm::dvec3& half_sizes) {
  XrcPrimitive& shape = append(XRC_BOX, {centre - half_sizes, centre + half_sizes});
  store(shape.a, centre);
  store(shape.b, {1, 0, 0});
  store(shape.c, {0, 1, 0});
  store(shape.size, half_sizes);
}

void PhantomScene::capsule(const VesselPoint& from, const VesselPoint& to) { tube(std::vector{from, to}); }

void PhantomScene::tube(std::span<const VesselPoint> points, const glm::dvec3& flat, double flattening) {
  for (std::size_t i = 1; i < points.size(); ++i) {
    const VesselPoint &from = points[i - 1], &to = points[i];
    XrcPrimitive& shape =
        append(XRC_CAPSULE, {glm::min(from.position_mm - from.radius_mm, to.position_mm - to.radius_mm),
                             glm::max(from.position_mm + from.radius_mm, to.position_mm + to.radius_mm)});
    store(shape.a, from.position_mm);
    store(shape.b, to.position_mm);
    store(shape.c, flat);
    store(shape.size, {from.radius_mm, to.radius_mm, flattening});
  }
}

void PhantomScene::plate(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double radius_mm) {
  XrcPrimitive& shape =
      append(XRC_PLATE, {glm::min(a, glm::min(b, c)) - radius_mm, glm::max(a, glm::max(b, c)) + radius_mm});
  store(shape.a, a);
  store(shape.b, b);
  store(shape.c, c);
  shape.size[0] = static_cast<float>(radius_mm);
}

void PhantomScene::loft(const Loft& loft) {
  const double bottom = loft.sections.front().z_mm, top = loft.sections.back().z_mm;
  const int pieces = static_cast<int>(std::ceil((top - bottom) / kStationStep_mm));
  const int first = static_cast<int>(stations_.size());
  Box bounds{{kFar, kFar, bottom}, {-kFar, -kFar, top}};
  for (int i = 0; i <= pieces; ++i) {
    const Loft::Section s = loft.at(glm::mix(bottom, top, static_cast<double>(i) / pieces));
    stations_.push_back({static_cast<float>(s.x_mm), static_cast<float>(s.y_mm), static_cast<float>(s.a_mm),
                         static_cast<float>(s.b_mm)});
    bounds.lower_mm = glm::min(bounds.lower_mm, glm::dvec3(s.x_mm - s.a_mm, s.y_mm - s.b_mm, bottom));
    bounds.upper_mm = glm::max(bounds.upper_mm, glm::dvec3(s.x_mm + s.a_mm, s.y_mm + s.b_mm, top));
  }
  XrcPrimitive& shape = append(XRC_LOFT, bounds);
  store(shape.a, {bottom, (top - bottom) / pieces, 0});
  shape.exponents[0] = static_cast<float>(loft.exponent);
  shape.first = first;
  shape.count = pieces + 1;
}

// ---- evaluating -----------------------------------------------------------------------------------

double PhantomScene::distance_mm(const XrcPrimitive& shape, const glm::dvec3& point_mm) const {
  switch (shape.kind) {
    case XRC_SOLID:
      return solid_distance(shape, point_mm);
    case XRC_BOX:
      return box_distance(shape, point_mm);
    case XRC_CAPSULE:
      return capsule_distance(shape, point_mm);
    case XRC_PLATE:
      return plate_distance(shape, point_mm);
    default:
      return loft_distance(shape, stations_, point_mm);
  }
}

double PhantomScene::hu_at(const glm::dvec3& point_mm, double edge_mm) const {
  double hu = background_hu_, nearest = kFar;
  for (std::size_t i = 0; i < primitives_.size(); ++i) {
    const XrcPrimitive& shape = primitives_[i];
    const glm::dvec3 outside = glm::max(load(shape.lower_mm) - point_mm, point_mm - load(shape.upper_mm));
    if (std::max({outside.x, outside.y, outside.z}) < edge_mm)
      nearest = std::min(nearest, distance_mm(shape, point_mm));
    if (i + 1 < primitives_.size() && primitives_[i + 1].layer == shape.layer) continue;
    const double coverage = std::clamp(0.5 - nearest / edge_mm, 0.0, 1.0);
    hu += coverage * (shape.is_additive ? shape.hu : shape.hu - hu);
    nearest = kFar;
  }
  return hu;
}

PhantomScene PhantomScene::indicator(std::string_view part, double hu) const {
  PhantomScene result = *this;
  result.background_hu_ = 0;
  for (XrcPrimitive& shape : result.primitives_) {
    assert(!shape.is_additive);
    shape.hu = parts_[static_cast<std::size_t>(shape.layer - 1)] == part ? static_cast<float>(hu) : 0;
  }
  return result;
}

bool PhantomScene::covers(const XrcPrimitive& shape, const Box& box, double edge_mm) const {
  if (shape.is_additive) return false;
  const glm::dvec3 outside =
      glm::max(load(shape.lower_mm) - box.lower_mm, box.upper_mm - load(shape.upper_mm));
  if (std::max({outside.x, outside.y, outside.z}) > 0) return false;
  // The shapes are convex, a loft nearly so within two stations: what holds the corners of a box, the edge's
  // whole width deep, holds all of it. A loft is asked at each of its stations on the way.
  const double step = shape.kind == XRC_LOFT ? shape.a[1] : box.upper_mm.z - box.lower_mm.z;
  for (double z = box.lower_mm.z;; z = std::min(z + step, box.upper_mm.z)) {
    for (const double x : {box.lower_mm.x, box.upper_mm.x})
      for (const double y : {box.lower_mm.y, box.upper_mm.y})
        if (distance_mm(shape, {x, y, z}) > -edge_mm) return false;
    if (z >= box.upper_mm.z) return true;
  }
}

}  // namespace xraycast
