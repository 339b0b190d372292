#include "xraycast/requests/rays_within.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/casting/outline_crossings.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

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

/// Of a ray in a map's circle, what lies in its outline: `is_within` of the share of the way, between places
/// where that changes.
template <typename IsWithin>
std::vector<RaySegment> parts_within(const RaySegment& ray, const std::vector<double>& changes,
                                     const IsWithin& is_within) {
  std::vector<RaySegment> parts;
  for (std::size_t i = 0; i + 1 < changes.size(); ++i)
    if (changes[i] < changes[i + 1] && is_within(0.5 * (changes[i] + changes[i + 1])))
      parts.push_back({glm::mix(ray.start_mm, ray.end_mm, changes[i]),
                       glm::mix(ray.start_mm, ray.end_mm, changes[i + 1])});
  return parts;
}

/// Bands of rows of a cylinder, and their outlines.
class BandedOutline {
 public:
  explicit BandedOutline(const MapGeometry& geometry) : geometry_(geometry) {
    for (const OutlineBand& band : outline_bands(geometry)) {
      const bool is_first = band.first_row == 0, is_last = band.first_row + band.rows == geometry.height;
      bands_.push_back({OutlineCrossings(geometry, band.first_row),
                        is_first ? kInfinity : geometry.z_mm(band.first_row - 0.5),
                        is_last ? -kInfinity : geometry.z_mm(band.first_row + band.rows - 0.5)});
    }
  }

  std::vector<RaySegment> parts_of(const RaySegment& ray) const {
    std::vector<RaySegment> parts;
    for (const Band& band : bands_) {
      const double start = ray.start_mm.z, rise = ray.end_mm.z - start;
      double from = 0, to = 1;
      if (std::abs(rise) > 1e-9) {
        const double a = (band.top_mm - start) / rise, b = (band.bottom_mm - start) / rise;
        from = std::max(from, std::min(a, b));
        to = std::min(to, std::max(a, b));
      } else if (start > band.top_mm || start <= band.bottom_mm) {
        continue;
      }
      if (from >= to) continue;
      const auto found = within(
          {glm::mix(ray.start_mm, ray.end_mm, from), glm::mix(ray.start_mm, ray.end_mm, to)}, band.outline);
      parts.insert(parts.end(), found.begin(), found.end());
    }
    return parts;
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  struct Band {
    OutlineCrossings outline;
    double top_mm, bottom_mm;
  };

  /// Of a ray that lies in one band.
  std::vector<RaySegment> within(const RaySegment& ray, const OutlineCrossings& outline) const {
    const glm::dvec2 start = glm::dvec2(ray.start_mm) - geometry_.centre_mm[0],
                     run = glm::dvec2(ray.end_mm) - glm::dvec2(ray.start_mm);
    const double length = glm::length(run);
    if (length < 1e-9) return {ray};  // along the axis
    const glm::dvec2 direction = run / length;
    const double foot_mm = -glm::dot(start, direction);
    const OutlineCrossings::Line line(outline, start + foot_mm * direction, direction);
    std::vector<double> changes{0};
    for (const auto& crossing : outline.crossings(line, std::array{geometry_.radius_mm()}))
      changes.push_back(std::clamp((crossing.along_mm + foot_mm) / length, 0.0, 1.0));
    changes.push_back(1);
    return parts_within(ray, changes, [&](double share) {
      return line.shell_radius_mm(share * length - foot_mm) < geometry_.radius_mm();
    });
  }

  const MapGeometry& geometry_;
  std::vector<Band> bands_;
};

/// In any outline, looked for in steps of a millimetre.
std::vector<RaySegment> within_outline(const RaySegment& ray, const MapGeometry& geometry) {
  const bool is_sphere = geometry.ray_layout == RayLayout::sphere;
  const glm::dvec3 centre(geometry.centre_mm[0], geometry.centre_z_mm);
  const auto is_within = [&](double share) {
    const glm::dvec3 place = glm::mix(ray.start_mm, ray.end_mm, share), p = place - centre;
    const double radius = is_sphere ? glm::length(p) : glm::length(glm::dvec2(p));
    const double turn = std::atan2(p.x, -p.y) / (2 * std::numbers::pi);
    const double row = is_sphere ? std::acos(std::clamp(p.z / std::max(radius, 1e-9), -1.0, 1.0)) /
                                           std::numbers::pi * geometry.height -
                                       0.5
                                 : (geometry.top_mm - place.z) / geometry.row_spacing_mm;
    return geometry.shell_radius_mm(radius, turn * geometry.width - 0.5, row) < geometry.radius_mm();
  };
  const int steps = static_cast<int>(std::ceil(glm::distance(ray.start_mm, ray.end_mm)));
  std::vector<double> changes{0};
  bool was_within = is_within(0);
  for (int i = 1; i <= steps; ++i) {
    double from = (i - 1.0) / steps, to = 1.0 * i / steps;
    if (is_within(to) == was_within) continue;
    for (int halving = 0; halving < 20; ++halving) {
      const double middle = 0.5 * (from + to);
      (is_within(middle) == was_within ? from : to) = middle;
    }
    changes.push_back(0.5 * (from + to));
    was_within = !was_within;
  }
  changes.push_back(1);
  return parts_within(ray, changes, is_within);
}

}  // namespace

std::vector<PixelSegment> segments_within(const View& view, const MapGeometry& geometry) {
  const auto rays = rays_within(view, geometry);
  std::optional<BandedOutline> outline;
  // As they are drawn: more bands are marched through, where outlines are blended between rows.
  if (geometry.has_outline() && geometry.ray_layout == RayLayout::cylinder &&
      outline_bands(geometry).size() <= kMostOutlineBands)
    outline.emplace(geometry);
  std::vector<std::vector<RaySegment>> parts(rays.size());
  parallel_for(view.height, [&](std::int64_t row) {
    for (std::size_t i = static_cast<std::size_t>(row) * view.width;
         i < static_cast<std::size_t>(row + 1) * view.width; ++i)
      if (rays[i])
        parts[i] = outline                  ? outline->parts_of(*rays[i])
                   : geometry.has_outline() ? within_outline(*rays[i], geometry)
                                            : std::vector{*rays[i]};
  });
  std::vector<PixelSegment> segments;
  for (std::size_t pixel = 0; pixel < parts.size(); ++pixel)
    for (const RaySegment& part : parts[pixel]) segments.push_back({pixel, part});
  return segments;
}

std::vector<std::optional<RaySegment>> rays_within(const View& view, const MapGeometry& geometry) {
  if (geometry.centre_mm.size() > 1)
    throw InputError("a map with a curved axis cannot be compared; cast it with a straight axis");
  const bool is_sphere = geometry.ray_layout == RayLayout::sphere;
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
