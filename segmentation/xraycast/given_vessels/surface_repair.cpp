#include "xraycast/given_vessels/surface_repair.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/union_find.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace xraycast {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

/// The same surface with one point where several coincide.
Mesh joined(const Mesh& surface) {
  std::vector<std::uint32_t> order(surface.points_mm.size()), point_of(order.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t i) {
    const glm::vec3& p = surface.points_mm[i];
    return std::array{p.x, p.y, p.z};
  };
  std::ranges::sort(order, {}, key);
  Mesh mesh;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || key(order[i]) != key(order[i - 1])) mesh.points_mm.push_back(surface.points_mm[order[i]]);
    point_of[order[i]] = static_cast<std::uint32_t>(mesh.points_mm.size() - 1);
  }
  for (const auto& [a, b, c] : surface.triangles)
    mesh.triangles.push_back({point_of[a], point_of[b], point_of[c]});
  return mesh;
}

double area_mm2(const Mesh& mesh, const Triangle& t) {
  const glm::dvec3 a = mesh.points_mm[t[0]], b = mesh.points_mm[t[1]], c = mesh.points_mm[t[2]];
  return 0.5 * glm::length(glm::cross(b - a, c - a));
}

/// Removes triangles without an area and all but one of those with the same corners. Returns how many.
std::size_t drop_useless(Mesh& mesh) {
  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles, [&](const Triangle& t) { return !(area_mm2(mesh, t) > 0); });
  const auto corners = [](Triangle t) {
    std::ranges::sort(t);
    return t;
  };
  std::ranges::stable_sort(mesh.triangles, {}, corners);
  mesh.triangles.erase(
      std::unique(mesh.triangles.begin(), mesh.triangles.end(),
                  [&](const Triangle& a, const Triangle& b) { return corners(a) == corners(b); }),
      mesh.triangles.end());
  return before - mesh.triangles.size();
}

std::size_t pieces_of(const Mesh& mesh) {
  UnionFind points(mesh.points_mm.size());
  std::vector<bool> is_used(mesh.points_mm.size());
  std::size_t pieces = 0;
  const auto use = [&](std::uint32_t point) {
    if (!is_used[point]) is_used[point] = true, ++pieces;
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    for (const std::uint32_t point : {a, b, c}) use(point);
    pieces -= points.unite(a, b) ? 1 : 0;
    pieces -= points.unite(a, c) ? 1 : 0;
  }
  return pieces;
}

/// The edges of one triangle alone, in the direction in which a triangle beyond would run along them: from
/// each point, where they lead to.
struct Borders {
  std::unordered_multimap<std::uint32_t, std::uint32_t> next;
  std::size_t branching_edges = 0;

  explicit Borders(const Mesh& mesh) {
    struct Side {
      std::uint32_t low, high;
      bool is_rising;
    };
    std::vector<Side> sides;
    for (const Triangle& t : mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t from = t[k], to = t[(k + 1) % 3];
        sides.push_back({std::min(from, to), std::max(from, to), from < to});
      }
    const auto edge = [](const Side& side) { return std::pair(side.low, side.high); };
    std::ranges::sort(sides, {}, edge);
    for (auto first = sides.begin(); first != sides.end();) {
      const auto last =
          std::find_if(first, sides.end(), [&](const Side& s) { return edge(s) != edge(*first); });
      if (last - first == 1)
        first->is_rising ? next.emplace(first->high, first->low) : next.emplace(first->low, first->high);
      branching_edges += last - first > 2 ? 1 : 0;
      first = last;
    }
  }

  /// Takes out the edges of one opening, in order; nothing where none is left. An edge that leads nowhere
  /// ends it.
  std::vector<std::uint32_t> take_loop() {
    std::vector<std::uint32_t> loop;
    if (next.empty()) return loop;
    auto edge = next.begin();
    do {
      loop.push_back(edge->first);
      const std::uint32_t to = edge->second;
      next.erase(edge);
      edge = next.find(to);
    } while (edge != next.end());
    return loop;
  }
};

/// Closes an opening by triangles between its edges and its centre.
Opening close(const std::vector<std::uint32_t>& loop, Mesh& mesh) {
  glm::dvec3 centre_mm(0);
  double length_mm = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const glm::dvec3 a = mesh.points_mm[loop[i]], b = mesh.points_mm[loop[(i + 1) % loop.size()]];
    centre_mm += 0.5 * glm::distance(a, b) * (a + b);
    length_mm += glm::distance(a, b);
  }
  centre_mm /= length_mm;
  const auto middle = static_cast<std::uint32_t>(mesh.points_mm.size());
  mesh.points_mm.emplace_back(centre_mm);
  for (std::size_t i = 0; i < loop.size(); ++i)
    mesh.triangles.push_back({loop[i], loop[(i + 1) % loop.size()], middle});
  return {centre_mm, length_mm / (2 * std::numbers::pi)};
}

}  // namespace

std::vector<std::string> RepairedSurface::notes(const std::string& name) const {
  std::vector<std::string> lines;
  if (dropped > 0)
    lines.push_back(
        fmt::format("{}: left out {} without an area or there twice", name, pluralize(dropped, "triangle")));
  if (branching_edges > 0)
    lines.push_back(
        fmt::format("{}: more than two triangles meet at {}", name, pluralize(branching_edges, "edge")));
  if (was_inside_out) lines.push_back(fmt::format("{}: is inside out; its normals were turned", name));
  return lines;
}

RepairedSurface repaired(const Mesh& surface, const std::string& name) {
  if (surface.triangles.empty()) throw InputError("{}: has no triangles; give a surface", name);
  RepairedSurface result{joined(surface), {}};
  Mesh& mesh = result.mesh;
  result.dropped = drop_useless(mesh);
  if (mesh.triangles.empty()) throw InputError("{}: none of its triangles has an area", name);
  result.pieces = pieces_of(mesh);
  Borders borders(mesh);
  result.branching_edges = borders.branching_edges;
  for (auto loop = borders.take_loop(); !loop.empty(); loop = borders.take_loop())
    if (loop.size() > 2) result.openings.push_back(close(loop, mesh));
  const double mm3 = volume_mm3(mesh);
  const double area = std::transform_reduce(mesh.triangles.begin(), mesh.triangles.end(), 0.0, std::plus(),
                                            [&](const Triangle& t) { return area_mm2(mesh, t); });
  // A sphere of the same area has the most volume; a millionth of it is rounding.
  if (std::abs(mm3) < 1e-6 * std::pow(area, 1.5))
    throw InputError(
        "{}: encloses no volume; give a surface that is closed, or open at the ends of its vessels only",
        name);
  result.was_inside_out = mm3 < 0;
  if (result.was_inside_out)
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return result;
}

}  // namespace xraycast
