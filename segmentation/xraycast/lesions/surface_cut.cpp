#include "xraycast/lesions/surface_cut.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/base/union_find.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>

namespace xraycast {
namespace {

using Corner = std::uint32_t;

std::uint64_t edge_key(Corner a, Corner b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b);
}

glm::dvec3 middle_of(const Mesh& mesh, Corner a, Corner b) {
  return 0.5 * (glm::dvec3(mesh.points_mm[a]) + glm::dvec3(mesh.points_mm[b]));
}

/// The measure at each point of a mesh, in parallel.
std::vector<double> measured(const Mesh& mesh, const PointMeasure& measure) {
  std::vector<double> values(mesh.points_mm.size());
  constexpr std::int64_t kTogether = 1024;
  const auto count = static_cast<std::int64_t>(values.size());
  parallel_for((count + kTogether - 1) / kTogether, [&](std::int64_t block) {
    for (std::int64_t i = block * kTogether; i < std::min(count, (block + 1) * kTogether); ++i)
      values[static_cast<std::size_t>(i)] = measure(mesh.points_mm[static_cast<std::size_t>(i)]);
  });
  return values;
}

/// The middles of the edges that are too long, added to the mesh: one for both triangles of an edge.
std::unordered_map<std::uint64_t, Corner> halved_edges(Mesh& mesh, std::vector<double>& limits_mm,
                                                       const PointMeasure& edge_mm) {
  std::unordered_map<std::uint64_t, Corner> middles;
  std::unordered_map<std::uint64_t, bool> is_seen;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Corner a = triangle[k], b = triangle[(k + 1) % 3];
      if (!is_seen.emplace(edge_key(a, b), true).second) continue;
      const double length_mm = glm::distance(glm::dvec3(mesh.points_mm[a]), glm::dvec3(mesh.points_mm[b]));
      constexpr double kShortest_mm = 0.1;  // no limit is below
      if (length_mm < kShortest_mm) continue;
      const glm::dvec3 middle_mm = middle_of(mesh, a, b);
      const double limit_mm = edge_mm(middle_mm);
      if (length_mm <= std::min({limits_mm[a], limits_mm[b], limit_mm})) continue;
      middles.emplace(edge_key(a, b), static_cast<Corner>(mesh.points_mm.size()));
      mesh.points_mm.emplace_back(middle_mm);
      limits_mm.push_back(limit_mm);
    }
  return middles;
}

/// A triangle with none, one, two or three of its edges halved.
void add_halved(const Mesh& mesh, const std::array<Corner, 3>& triangle,
                const std::unordered_map<std::uint64_t, Corner>& middles,
                std::vector<std::array<Corner, 3>>& triangles) {
  std::array<std::int64_t, 3> m{-1, -1, -1};  // of the edge from corner k to k + 1
  int halved = 0;
  for (std::size_t k = 0; k < 3; ++k)
    if (const auto found = middles.find(edge_key(triangle[k], triangle[(k + 1) % 3])); found != middles.end())
      m[k] = found->second, ++halved;
  const auto add = [&](std::int64_t a, std::int64_t b, std::int64_t c) {
    triangles.push_back({static_cast<Corner>(a), static_cast<Corner>(b), static_cast<Corner>(c)});
  };
  if (halved == 0) return add(triangle[0], triangle[1], triangle[2]);
  if (halved == 3) {
    add(m[0], m[1], m[2]);
    for (std::size_t k = 0; k < 3; ++k) add(triangle[k], m[k], m[(k + 2) % 3]);
    return;
  }
  // Turned so that the edge from a to b is halved and, of two, that from b to c.
  std::size_t k = 0;
  while (m[k] < 0 || (halved == 2 && m[(k + 1) % 3] < 0)) ++k;
  const Corner a = triangle[k], b = triangle[(k + 1) % 3], c = triangle[(k + 2) % 3];
  const std::int64_t ab = m[k], bc = m[(k + 1) % 3];
  if (halved == 1) return add(a, ab, c), add(ab, b, c);
  add(ab, b, bc);
  const auto length = [&](std::int64_t p, std::int64_t q) {
    return glm::distance(mesh.points_mm[static_cast<std::size_t>(p)],
                         mesh.points_mm[static_cast<std::size_t>(q)]);
  };
  if (length(a, bc) < length(ab, c))
    add(a, ab, bc), add(a, bc, c);
  else
    add(a, ab, c), add(ab, bc, c);
}

/// Where a measure is zero between a point where it is above and one where it is not.
glm::dvec3 zero_between(glm::dvec3 above_mm, glm::dvec3 below_mm, const PointMeasure& measure) {
  for (int halving = 0; halving < 40; ++halving) {
    const glm::dvec3 middle_mm = 0.5 * (above_mm + below_mm);
    (measure(middle_mm) > 0 ? above_mm : below_mm) = middle_mm;
  }
  return above_mm;
}

/// The loops of a surface's open edges, each against the direction of its triangles' edges.
void find_loops(CutSurface& cut) {
  std::map<std::pair<Corner, Corner>, int> edges;
  for (const auto& t : cut.part.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  std::map<Corner, Corner> next;
  for (const auto& [edge, count] : edges) {
    if (edges.contains({edge.second, edge.first})) continue;
    cut.is_clean = cut.is_clean && next.emplace(edge.first, edge.second).second;
  }
  while (!next.empty()) {
    std::vector<Corner> loop{next.begin()->first};
    for (;;) {
      const auto step = next.find(loop.back());
      if (step == next.end()) break;
      loop.push_back(step->second);
      next.erase(step);
    }
    cut.is_clean = cut.is_clean && loop.size() > 3 && loop.front() == loop.back();
    loop.pop_back();
    cut.loops.push_back(std::move(loop));
  }
}

}  // namespace

Mesh with_shorter_edges(const Mesh& mesh, const PointMeasure& edge_mm) {
  Mesh finer = mesh;
  std::vector<double> limits_mm = measured(mesh, edge_mm);
  for (int pass = 0; pass < 12; ++pass) {
    check_cancelled();
    const auto middles = halved_edges(finer, limits_mm, edge_mm);
    if (middles.empty()) break;
    std::vector<std::array<Corner, 3>> triangles;
    triangles.reserve(finer.triangles.size() + 3 * middles.size());
    for (const auto& triangle : finer.triangles) add_halved(finer, triangle, middles, triangles);
    finer.triangles = std::move(triangles);
  }
  return finer;
}

CutSurface part_above_zero(const Mesh& mesh, const PointMeasure& measure) {
  CutSurface cut;
  cut.part.points_mm = mesh.points_mm;
  const std::vector<double> values = measured(mesh, measure);
  std::unordered_map<std::uint64_t, Corner> zeros;
  const auto zero = [&](Corner above, Corner below) {
    const auto [found, is_new] =
        zeros.emplace(edge_key(above, below), static_cast<Corner>(cut.part.points_mm.size()));
    if (is_new)
      cut.part.points_mm.emplace_back(zero_between(mesh.points_mm[above], mesh.points_mm[below], measure));
    return found->second;
  };
  for (const auto& t : mesh.triangles) {
    const auto is_above = [&](std::size_t k) { return values[t[k % 3]] > 0; };
    const int count = is_above(0) + is_above(1) + is_above(2);
    if (count == 3) cut.part.triangles.push_back(t);
    if (count == 0 || count == 3) continue;
    // Turned so that the corner that differs comes first.
    std::size_t k = 0;
    while (is_above(k) != (count == 1)) ++k;
    const Corner a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
    if (count == 1) {
      cut.part.triangles.push_back({a, zero(a, b), zero(a, c)});
    } else {
      const Corner ab = zero(b, a), ac = zero(c, a);
      cut.part.triangles.push_back({ab, b, c});
      cut.part.triangles.push_back({ab, c, ac});
    }
  }
  find_loops(cut);
  return cut;
}

void close_loop(Mesh& mesh, const std::vector<std::uint32_t>& loop, int rings, const glm::dvec3& middle_mm,
                const std::function<glm::dvec3(std::size_t i, int ring)>& point_mm) {
  const std::size_t count = loop.size();
  std::vector<Corner> outer = loop;
  for (int ring = 1; ring < rings; ++ring) {
    std::vector<Corner> inner;
    for (std::size_t i = 0; i < count; ++i) {
      inner.push_back(static_cast<Corner>(mesh.points_mm.size()));
      mesh.points_mm.emplace_back(point_mm(i, ring));
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t next = (i + 1) % count;
      mesh.triangles.push_back({outer[next], outer[i], inner[i]});
      mesh.triangles.push_back({outer[next], inner[i], inner[next]});
    }
    outer = std::move(inner);
  }
  const auto middle = static_cast<Corner>(mesh.points_mm.size());
  mesh.points_mm.emplace_back(middle_mm);
  for (std::size_t i = 0; i < count; ++i)
    mesh.triangles.push_back({outer[(i + 1) % count], outer[i], middle});
}

Mesh without_loose_points(const Mesh& mesh) {
  constexpr Corner kNone = ~Corner{0};
  std::vector<Corner> number(mesh.points_mm.size(), kNone);
  for (const auto& triangle : mesh.triangles)
    for (const Corner corner : triangle) number[corner] = 0;
  Mesh kept;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] != kNone) {
      number[i] = static_cast<Corner>(kept.points_mm.size());
      kept.points_mm.push_back(mesh.points_mm[i]);
    }
  for (const auto& [a, b, c] : mesh.triangles) kept.triangles.push_back({number[a], number[b], number[c]});
  return kept;
}

std::size_t piece_count(const Mesh& mesh) {
  UnionFind pieces(mesh.points_mm.size());
  std::vector<char> is_used(mesh.points_mm.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    pieces.unite(a, b), pieces.unite(a, c);
    is_used[a] = 1;
  }
  std::vector<char> is_piece(mesh.points_mm.size());
  for (std::size_t i = 0; i < is_used.size(); ++i)
    if (is_used[i] != 0) is_piece[pieces.find(i)] = 1;
  return static_cast<std::size_t>(std::count(is_piece.begin(), is_piece.end(), 1));
}

}  // namespace xraycast
