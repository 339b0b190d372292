#include "xraycast/geometry/tube.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace xraycast {
namespace {

/// `v`, turned by the smallest rotation that takes the unit vector `from` to `to`.
glm::dvec3 transported(const glm::dvec3& v, const glm::dvec3& from, const glm::dvec3& to) {
  const glm::dvec3 axis = glm::cross(from, to);
  const double cosine = glm::dot(from, to);
  if (cosine < -1 + 1e-9) return v;  // a hairpin: v stays perpendicular to both
  return v + glm::cross(axis, v) + glm::cross(axis, glm::cross(axis, v)) / (1 + cosine);
}

glm::dvec3 any_perpendicular(const glm::dvec3& v) {
  const glm::dvec3 a = glm::abs(v);
  const glm::dvec3 least = a.x <= a.y && a.x <= a.z ? glm::dvec3(1, 0, 0)
                           : a.y <= a.z             ? glm::dvec3(0, 1, 0)
                                                    : glm::dvec3(0, 0, 1);
  return glm::normalize(glm::cross(v, least));
}

/// The cross-sections that stand on tangents; the frame is transported from the direction `first` on.
std::vector<Ring> rings_across(std::span<const VesselPoint> points, const glm::dvec3& first,
                               const std::vector<glm::dvec3>& tangents) {
  std::vector<Ring> rings;
  glm::dvec3 tangent = first, normal = any_perpendicular(first);
  for (std::size_t k = 0; k < points.size(); ++k) {
    const glm::dvec3& next = tangents[k];
    normal = transported(normal, tangent, next);
    normal = glm::normalize(normal - glm::dot(normal, next) * next);
    tangent = next;
    rings.push_back({points[k].position_mm, points[k].radius_mm, normal, glm::cross(tangent, normal)});
  }
  return rings;
}

/// The point that is a radius on along the line from point k, or back for a step of -1; else the line's end.
const glm::dvec3& a_radius_on(std::span<const VesselPoint> points, std::size_t k, int step) {
  const std::size_t end = step > 0 ? points.size() - 1 : 0;
  const double radius_mm = points[k].radius_mm;
  for (double way_mm = 0; way_mm < radius_mm && k != end; k += step)
    way_mm += glm::distance(points[k].position_mm, points[k + step].position_mm);
  return points[k].position_mm;
}

/// The cross-sections of a tube's round end beyond `ring`, but for the pole; outwards from the ring.
std::vector<Ring> rings_of_end(const Ring& ring, const glm::dvec3& outwards, int count) {
  std::vector<Ring> rings;
  for (int i = 1; i < count; ++i) {
    const double latitude = 0.5 * std::numbers::pi * i / count;
    rings.push_back({ring.centre_mm + ring.radius_mm * std::sin(latitude) * outwards,
                     ring.radius_mm * std::cos(latitude), ring.normal, ring.binormal});
  }
  return rings;
}

/// The branch's cross-sections with those of its round ends, but for the two poles.
std::vector<Ring> rings_with_ends(const std::vector<VesselPoint>& points, int rings_per_end) {
  std::vector<Ring> rings = rings_along(points);
  const auto outwards = [](const Ring& ring) { return glm::cross(ring.normal, ring.binormal); };
  const auto last = rings_of_end(rings.back(), outwards(rings.back()), rings_per_end);
  auto first = rings_of_end(rings.front(), -outwards(rings.front()), rings_per_end);
  std::reverse(first.begin(), first.end());
  rings.insert(rings.begin(), first.begin(), first.end());
  rings.insert(rings.end(), last.begin(), last.end());
  return rings;
}

void add_tube(const std::vector<VesselPoint>& points, std::uint32_t sides, Mesh& mesh) {
  const int rings_per_end = std::max(1, static_cast<int>(sides) / 4);  // about square faces
  const std::vector<Ring> rings = rings_with_ends(points, rings_per_end);
  const auto pole = [&](const Ring& ring, const VesselPoint& end, double side) {
    mesh.points_mm.emplace_back(end.position_mm +
                                side * end.radius_mm * glm::cross(ring.normal, ring.binormal));
    return static_cast<std::uint32_t>(mesh.points_mm.size() - 1);
  };

  const std::uint32_t first_pole = pole(rings.front(), points.front(), -1);
  const std::uint32_t first_ring = first_pole + 1;
  for (const Ring& ring : rings) {
    for (std::uint32_t i = 0; i < sides; ++i) {
      mesh.points_mm.emplace_back(ring.at_mm(2 * std::numbers::pi * i / sides));
    }
  }
  const std::uint32_t last_pole = pole(rings.back(), points.back(), 1);

  for (std::uint32_t i = 0; i < sides; ++i) {
    const std::uint32_t next = (i + 1) % sides, last_ring = last_pole - sides;
    mesh.triangles.push_back({first_pole, first_ring + next, first_ring + i});
    for (std::uint32_t below = first_ring; below < last_ring; below += sides) {
      const std::uint32_t above = below + sides;
      mesh.triangles.push_back({below + i, below + next, above + next});
      mesh.triangles.push_back({below + i, above + next, above + i});
    }
    mesh.triangles.push_back({last_pole, last_ring + i, last_ring + next});
  }
}

}  // namespace

glm::dvec3 Ring::at_mm(double angle_rad) const {
  return centre_mm + radius_mm * (std::cos(angle_rad) * normal + std::sin(angle_rad) * binormal);
}

std::vector<Ring> rings_along(std::span<const VesselPoint> points) {
  std::vector<glm::dvec3> directions, tangents;
  for (std::size_t k = 0; k + 1 < points.size(); ++k)
    directions.push_back(glm::normalize(points[k + 1].position_mm - points[k].position_mm));
  for (std::size_t k = 0; k < points.size(); ++k) {
    const glm::dvec3 before = directions[k == 0 ? 0 : k - 1],
                     after = directions[std::min(k, directions.size() - 1)];
    const glm::dvec3 sum = before + after;
    tangents.push_back(glm::length(sum) > 1e-6 ? glm::normalize(sum) : after);
  }
  return rings_across(points, directions.front(), tangents);
}

std::vector<Ring> rings_across_chords(std::span<const VesselPoint> points) {
  std::vector<glm::dvec3> tangents;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const std::size_t before = k == 0 ? 0 : k - 1;
    const glm::dvec3 chord = a_radius_on(points, k, 1) - a_radius_on(points, k, -1),
                     step = points[before + 1].position_mm - points[before].position_mm;
    tangents.push_back(glm::normalize(glm::length(chord) > 1e-6 ? chord : step));
  }
  return rings_across(points, tangents.front(), tangents);
}

Mesh tube_mesh(const VesselTree& tree, int sides) {
  assert(sides >= 3);
  Mesh mesh;
  for (const VesselBranch& branch : tree.branches())
    add_tube(branch.points, static_cast<std::uint32_t>(sides), mesh);
  return mesh;
}

}  // namespace xraycast
