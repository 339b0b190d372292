#include "xraycast/lesions/edited_surface.hpp"

#include "xraycast/lesions/surface_cut.hpp"
#include "xraycast/lesions/tube_places.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

constexpr double kAnyLength = std::numeric_limits<double>::infinity();

/// Between two unit vectors along the great circle.
glm::dvec3 on_great_circle(const glm::dvec3& from, const glm::dvec3& to, double fraction) {
  const double angle = std::acos(std::clamp(glm::dot(from, to), -1.0, 1.0));
  if (angle < 1e-6) return from;
  return (std::sin((1 - fraction) * angle) * from + std::sin(fraction * angle) * to) / std::sin(angle);
}

/// Closes the opening of a ball by the rest of the ball.
void add_dome(Mesh& mesh, const std::vector<std::uint32_t>& loop, const SacBall& ball, double edge_mm) {
  const glm::dvec3 centre_mm = ball.centre_mm();
  std::vector<glm::dvec3> rim;
  double widest = 0;
  for (const std::uint32_t point : loop) {
    rim.push_back(glm::normalize(glm::dvec3(mesh.points_mm[point]) - centre_mm));
    widest = std::max(widest, std::acos(std::clamp(glm::dot(rim.back(), ball.outwards), -1.0, 1.0)));
  }
  const int rings = std::max(4, static_cast<int>(std::ceil(widest * ball.radius_mm / edge_mm)));
  close_loop(mesh, loop, rings, centre_mm + ball.radius_mm * ball.outwards, [&](std::size_t i, int ring) {
    return centre_mm +
           ball.radius_mm * on_great_circle(rim[i], ball.outwards, static_cast<double>(ring) / rings);
  });
}

/// Where a ray crosses a triangle from inside to outside: the distance; nothing elsewhere.
std::optional<double> way_out_mm(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle,
                                 const glm::dvec3& from_mm, const glm::dvec3& direction) {
  const glm::dvec3 a = mesh.points_mm[triangle[0]], u = glm::dvec3(mesh.points_mm[triangle[1]]) - a,
                   v = glm::dvec3(mesh.points_mm[triangle[2]]) - a, p = glm::cross(direction, v);
  const double volume = glm::dot(u, p);
  // Seen from within, an outer wall's corners run clockwise.
  if (volume >= 0) return {};
  const glm::dvec3 s = from_mm - a, q = glm::cross(s, u);
  const double f = glm::dot(s, p) / volume, g = glm::dot(direction, q) / volume, t = glm::dot(v, q) / volume;
  if (f < 0 || g < 0 || f + g > 1 || t <= 0) return {};
  return t;
}

/// Closes a cut along the wall of a tree: points between the loop and its middle take the distance from the
/// centreline that the wall has, and the loop's own near to it.
void add_patch(Mesh& mesh, const std::vector<std::uint32_t>& loop, const TubePlaces& lumens) {
  glm::dvec3 middle_mm(0);
  double around_mm = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const glm::dvec3 point_mm = mesh.points_mm[loop[i]];
    middle_mm += point_mm / static_cast<double>(loop.size());
    around_mm += glm::distance(point_mm, glm::dvec3(mesh.points_mm[loop[(i + 1) % loop.size()]]));
  }
  const auto on_wall = [&](const glm::dvec3& point_mm, double out_mm) {
    const TubePlace place = lumens.deepest(point_mm);
    const glm::dvec3 from_axis_mm = point_mm - place.centre_mm;
    const double away_mm = glm::length(from_axis_mm);
    return away_mm > 1e-6 ? place.centre_mm + (place.radius_mm + out_mm) / away_mm * from_axis_mm : point_mm;
  };
  std::vector<double> out_mm;
  std::vector<glm::dvec3> rim;
  for (const std::uint32_t point : loop) {
    rim.emplace_back(mesh.points_mm[point]);
    out_mm.push_back(lumens.deepest(rim.back()).out_mm);
  }
  const int rings = std::clamp(static_cast<int>(std::ceil(around_mm / 2)), 3, 12);
  close_loop(mesh, loop, rings, on_wall(middle_mm, 0), [&](std::size_t i, int ring) {
    const double inwards = static_cast<double>(ring) / rings;
    return on_wall(glm::mix(rim[i], middle_mm, inwards), (1 - inwards) * out_mm[i]);
  });
}

}  // namespace

Mesh moved_surface(const Mesh& surface, const WallChange& change) {
  if (change.is_empty()) return surface;
  Mesh moved = with_shorter_edges(surface, [&](const glm::dvec3& p) { return change.edge_mm(p); });
  for (glm::vec3& point_mm : moved.points_mm) {
    const glm::dvec3 was_mm = point_mm, is_mm = change.moved(was_mm);
    if (is_mm != was_mm) point_mm = is_mm;
  }
  return moved;
}

std::optional<double> wall_in_direction_mm(const Mesh& surface, const glm::dvec3& from_mm,
                                           const glm::dvec3& direction, double about_mm) {
  std::optional<double> best;
  for (const auto& triangle : surface.triangles)
    if (const auto mm = way_out_mm(surface, triangle, from_mm, direction);
        mm && (!best || std::abs(*mm - about_mm) < std::abs(*best - about_mm)))
      best = mm;
  if (best && (*best > 2 * about_mm || 2 * *best < about_mm)) return {};
  return best;
}

std::optional<Mesh> with_sac(const Mesh& surface, const SacBall& ball) {
  const double edge_mm = std::clamp(ball.radius_mm / 12, 0.1, 0.6);
  const glm::dvec3 centre_mm = ball.centre_mm();
  const auto beyond_mm = [&](const glm::dvec3& p) { return glm::distance(p, centre_mm) - ball.radius_mm; };
  const Mesh finer = with_shorter_edges(surface, [&](const glm::dvec3& p) {
    const double mm = std::abs(beyond_mm(p));
    return mm < 2 * edge_mm ? edge_mm : std::max(edge_mm, mm);
  });
  CutSurface cut = part_above_zero(finer, beyond_mm);
  if (!cut.is_clean || cut.loops.size() != 1) return {};
  add_dome(cut.part, cut.loops.front(), ball, edge_mm);
  return without_loose_points(cut.part);
}

Mesh without_branches(const Mesh& surface, const VesselTree& tree, const std::vector<bool>& is_removed) {
  std::vector<bool> is_kept = is_removed;
  is_kept.flip();
  const TubePlaces kept(tree, is_kept), removed(tree, is_removed);
  const auto nearer_to_kept_mm = [&](const glm::dvec3& p) {
    return removed.deepest(p).out_mm - kept.deepest(p).out_mm;
  };
  const Mesh finer = with_shorter_edges(surface, [&](const glm::dvec3& p) {
    const TubePlace place = removed.deepest(p);
    if (place.out_mm > place.radius_mm) return kAnyLength;
    const double mm = std::abs(place.out_mm - kept.deepest(p).out_mm),
                 edge_mm = std::clamp(place.radius_mm / 4, 0.15, 1.0);
    return mm < 2 * edge_mm ? edge_mm : std::max(edge_mm, mm);
  });
  CutSurface cut = part_above_zero(finer, nearer_to_kept_mm);
  for (const auto& loop : cut.loops)
    if (loop.size() > 2) add_patch(cut.part, loop, kept);
  return without_loose_points(cut.part);
}

}  // namespace xraycast
