#include "xraycast/given_vessels/surface_crossings.hpp"

#include "xraycast/base/parallel.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace xraycast {
namespace {

using Corners = std::array<glm::dvec3, 3>;

/// Whether a stretch crosses a triangle, by the signs of volumes.
bool crosses(const glm::dvec3& a, const glm::dvec3& b, const Corners& t) {
  const auto volume = [](const glm::dvec3& p, const glm::dvec3& q, const glm::dvec3& r, const glm::dvec3& s) {
    return glm::dot(q - p, glm::cross(r - p, s - p));
  };
  const double above = volume(t[0], t[1], t[2], a), below = volume(t[0], t[1], t[2], b);
  if (above * below >= 0) return false;
  const double x = volume(a, b, t[0], t[1]), y = volume(a, b, t[1], t[2]), z = volume(a, b, t[2], t[0]);
  return (x > 0 && y > 0 && z > 0) || (x < 0 && y < 0 && z < 0);
}

bool crosses(const Corners& a, const Corners& b) {
  for (std::size_t k = 0; k < 3; ++k)
    if (crosses(a[k], a[(k + 1) % 3], b) || crosses(b[k], b[(k + 1) % 3], a)) return true;
  return false;
}

/// Triangles in the cells of a grid that their boxes touch.
class TriangleGrid {
 public:
  explicit TriangleGrid(const Mesh& mesh) : mesh_(mesh) {
    double sum_mm = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const glm::dvec3 size = high(i) - low(i);
      sum_mm += std::max({size.x, size.y, size.z});
      lowest_mm_ = glm::min(lowest_mm_, low(i));
    }
    cell_mm_ = sum_mm / static_cast<double>(mesh.triangles.size());
    while (entries() > kMostCells * mesh.triangles.size()) cell_mm_ *= 2;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
      each_cell(i,
                [&](const Cell& cell) { in_cells_.emplace_back(key(cell), static_cast<std::uint32_t>(i)); });
    std::ranges::sort(in_cells_);
  }

  std::int64_t count_crossings() const {
    std::vector<std::size_t> starts;
    for (std::size_t i = 0; i < in_cells_.size(); ++i)
      if (i == 0 || in_cells_[i].first != in_cells_[i - 1].first) starts.push_back(i);
    starts.push_back(in_cells_.size());
    constexpr std::int64_t kTogether = 4096;
    std::atomic<std::int64_t> count = 0;
    parallel_for((std::ssize(starts) + kTogether - 2) / kTogether, [&](std::int64_t part) {
      const auto first = static_cast<std::size_t>(part * kTogether);
      std::int64_t here = 0;
      for (std::size_t s = first; s < std::min(first + kTogether, starts.size() - 1); ++s)
        here += count_in(starts[s], starts[s + 1]);
      count += here;
    });
    return count;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  static constexpr std::size_t kMostCells = 16;

  Corners corners(std::size_t i) const {
    const auto& [a, b, c] = mesh_.triangles[i];
    return {mesh_.points_mm[a], mesh_.points_mm[b], mesh_.points_mm[c]};
  }
  glm::dvec3 low(std::size_t i) const {
    const Corners c = corners(i);
    return glm::min(glm::min(c[0], c[1]), c[2]);
  }
  glm::dvec3 high(std::size_t i) const {
    const Corners c = corners(i);
    return glm::max(glm::max(c[0], c[1]), c[2]);
  }

  Cell cell_at(const glm::dvec3& point_mm) const {
    const glm::dvec3 at = glm::floor((point_mm - lowest_mm_) / cell_mm_);
    return {static_cast<std::int64_t>(at.x), static_cast<std::int64_t>(at.y),
            static_cast<std::int64_t>(at.z)};
  }
  static std::uint64_t key(const Cell& cell) {
    constexpr int kBits = 21;
    std::uint64_t key = 0;
    for (const std::int64_t k : cell)
      key = key << kBits | (static_cast<std::uint64_t>(k) & ((1ULL << kBits) - 1));
    return key;
  }

  std::size_t entries() const {
    double sum = 0;
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      const glm::dvec3 cells =
          glm::floor((high(i) - lowest_mm_) / cell_mm_) - glm::floor((low(i) - lowest_mm_) / cell_mm_) + 1.0;
      sum += cells.x * cells.y * cells.z;
    }
    return static_cast<std::size_t>(std::min(sum, 1e18));
  }

  void each_cell(std::size_t i, const auto& visit) const {
    const Cell from = cell_at(low(i)), to = cell_at(high(i));
    for (std::int64_t x = from[0]; x <= to[0]; ++x)
      for (std::int64_t y = from[1]; y <= to[1]; ++y)
        for (std::int64_t z = from[2]; z <= to[2]; ++z) visit(Cell{x, y, z});
  }

  bool share_a_corner(std::size_t i, std::size_t j) const {
    const auto &a = mesh_.triangles[i], &b = mesh_.triangles[j];
    return std::ranges::any_of(a, [&](std::uint32_t p) { return std::ranges::find(b, p) != b.end(); });
  }

  /// A pair counts in the cell of the lowest corner of what their boxes have in common.
  std::int64_t count_in(std::size_t first, std::size_t last) const {
    std::int64_t count = 0;
    for (std::size_t i = first; i < last; ++i)
      for (std::size_t j = i + 1; j < last; ++j) {
        const std::size_t a = in_cells_[i].second, b = in_cells_[j].second;
        const glm::dvec3 low_mm = glm::max(low(a), low(b));
        if (glm::any(glm::greaterThan(low_mm, glm::min(high(a), high(b)))) || share_a_corner(a, b) ||
            key(cell_at(low_mm)) != in_cells_[first].first)
          continue;
        count += crosses(corners(a), corners(b)) ? 1 : 0;
      }
    return count;
  }

  const Mesh& mesh_;
  glm::dvec3 lowest_mm_{std::numeric_limits<double>::infinity()};
  double cell_mm_ = 1;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> in_cells_;
};

}  // namespace

std::int64_t crossing_triangles(const Mesh& mesh) {
  return mesh.triangles.empty() ? 0 : TriangleGrid(mesh).count_crossings();
}

}  // namespace xraycast
