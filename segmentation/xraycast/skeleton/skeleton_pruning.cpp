#include "xraycast/skeleton/skeleton_pruning.hpp"

#include "xraycast/base/union_find.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

namespace xraycast {
namespace {

class SkeletonPruner {
 public:
  SkeletonPruner(SkeletonGraph graph, const Lumen& lumen, double spur_vox)
      : graph_(std::move(graph)), lumen_(lumen), spur_mm_(spur_vox * lumen.coarsest_mm()) {
    removed_.resize(graph_.edges.size());
  }

  SkeletonGraph run() {
    remove_spurs();  // else one on a ring would be where that is cut, and its end
    open_cycles();
    for (int n = 0; n < static_cast<int>(graph_.nodes.size()); ++n) dissolve(n);
    remove_spurs();
    merge_bifurcations();
    return remaining();
  }

  SkeletonGraph without(const std::vector<int>& leaves) {
    for (const int leaf : leaves) {
      const auto nodes = edge(leaf).nodes;
      remove(leaf);
      for (const int n : nodes) {
        // A loop that a leaf within the lumen closed only surrounded a hole.
        for (const int e : node(n).edges) edge(e).closes_loop = false;
        dissolve(n);
      }
    }
    return remaining();
  }

 private:
  SkeletonGraph::Edge& edge(int e) { return graph_.edges[static_cast<std::size_t>(e)]; }
  SkeletonGraph::Node& node(int n) { return graph_.nodes[static_cast<std::size_t>(n)]; }
  bool is_removed(int e) const { return removed_[static_cast<std::size_t>(e)]; }
  bool is_leaf(int n) { return node(n).edges.size() == 1; }
  double radius_mm(int n) { return lumen_.inscribed_radius_mm(node(n).position_mm); }
  int edge_count() const { return static_cast<int>(graph_.edges.size()); }

  void remove(int e) {
    removed_[static_cast<std::size_t>(e)] = true;
    for (const int n : edge(e).nodes) std::erase(node(n).edges, e);
  }

  // ---- cycles ----

  double mean_radius_mm(const SkeletonGraph::Edge& e) const {
    double sum = 0;
    for (const glm::dvec3& p : e.points_mm) sum += lumen_.inscribed_radius_mm(p);
    return sum / static_cast<double>(e.points_mm.size());
  }

  std::vector<int> thickest_first() const {
    std::vector<double> radii_mm;
    for (const SkeletonGraph::Edge& e : graph_.edges) radii_mm.push_back(mean_radius_mm(e));
    std::vector<int> order(graph_.edges.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, [&](int a, int b) {
      return radii_mm[static_cast<std::size_t>(a)] > radii_mm[static_cast<std::size_t>(b)];
    });
    return order;
  }

  void open_cycles() {
    constexpr double kHole_vox = 2;
    UnionFind trees(graph_.nodes.size());
    for (const int e : thickest_first()) {
      const auto [a, b] = edge(e).nodes;
      if (trees.unite(static_cast<std::size_t>(b), static_cast<std::size_t>(a))) continue;
      // Where a mask is full of holes, hardly a sphere fits in.
      const double around_hole_mm =
          2 * std::numbers::pi * std::max({radius_mm(a), radius_mm(b), kHole_vox * lumen_.voxel_mm()});
      if (length_mm(edge(e).points_mm) < around_hole_mm)
        remove(e);
      else
        cut_open(e);
    }
  }

  /// An edge ends a voxel before its second node, in a node of its own.
  void cut_open(int e) {
    const auto [start, end] = edge(e).nodes;
    std::erase(node(end).edges, e);
    if (start == end) node(end).edges.push_back(e);  // it was named twice there
    std::vector<glm::dvec3>& points_mm = edge(e).points_mm;
    points_mm.pop_back();
    if (points_mm.size() < 2) {
      removed_[static_cast<std::size_t>(e)] = true;
      std::erase(node(start).edges, e);
      return;
    }
    edge(e).closes_loop = true;
    edge(e).nodes[1] = static_cast<int>(graph_.nodes.size());
    graph_.nodes.push_back({points_mm.back(), {e}});
  }

  // ---- spurs ----

  /// How far the tip of an edge reaches out of the sphere inscribed where it leaves, less what voxels can
  /// tell; nothing for an inner edge and for one that is alone.
  std::optional<double> protrusion_mm(int e) {
    const auto [a, b] = edge(e).nodes;
    if (is_leaf(a) == is_leaf(b)) return std::nullopt;
    const int fork = is_leaf(a) ? b : a, tip = is_leaf(a) ? a : b;
    const double mm = length_mm(edge(e).points_mm) - radius_mm(fork) - std::max(spur_mm_, radius_mm(tip));
    return mm < 0 ? mm + to_side_mm(e, tip) : mm;
  }

  /// From a tip straight on in the lumen to the scan's side, if that is near; else 0.
  double to_side_mm(int e, int tip) {
    constexpr std::size_t kReach = 6;  // voxels of the edge that tell its direction
    constexpr double kFarthest = 2.5;  // in radii: a vessel is flat where it is about to fork
    constexpr double kInside = 0.5;
    const std::vector<glm::dvec3>& points_mm = edge(e).points_mm;
    const std::size_t back = std::min(kReach, points_mm.size() - 1);
    const glm::dvec3 end_mm = node(tip).position_mm, from_mm = edge(e).nodes[0] == tip
                                                                   ? points_mm[back]
                                                                   : points_mm[points_mm.size() - 1 - back];
    const double step_mm = lumen_.voxel_mm(), farthest_mm = kFarthest * radius_mm(tip) + step_mm;
    const glm::dvec3 step = step_mm * glm::normalize(end_mm - from_mm);
    for (int k = 1; k * step_mm <= farthest_mm; ++k) {
      const glm::dvec3 place_mm = end_mm + static_cast<double>(k) * step;
      if (!lumen_.contains(place_mm)) return k * step_mm;
      if (lumen_.occupancy(place_mm) < kInside) return 0;
    }
    return 0;
  }

  void remove_spurs() {
    for (;;) {
      check_cancelled();
      int shortest = -1;
      double least_mm = 0;
      for (int e = 0; e < edge_count(); ++e) {
        if (is_removed(e)) continue;
        if (const auto mm = protrusion_mm(e); mm && *mm < least_mm) shortest = e, least_mm = *mm;
      }
      if (shortest < 0) return;
      const auto nodes = edge(shortest).nodes;
      remove(shortest);
      for (const int n : nodes) dissolve(n);  // what forked there is one edge now
    }
  }

  /// The two edges of a node of degree 2 become one.
  void dissolve(int n) {
    if (node(n).edges.size() != 2 || node(n).edges[0] == node(n).edges[1]) return;
    const int a = node(n).edges[0], b = node(n).edges[1];
    if (edge(a).is_beyond_scan || edge(b).is_beyond_scan) return;
    if (edge(a).nodes[1] != n) reverse(edge(a));
    if (edge(b).nodes[0] != n) reverse(edge(b));
    edge(a).points_mm.insert(edge(a).points_mm.end(), edge(b).points_mm.begin() + 1, edge(b).points_mm.end());
    edge(a).closes_loop |= edge(b).closes_loop;
    const int end = edge(b).nodes[1];
    edge(a).nodes[1] = end;
    std::ranges::replace(node(end).edges, b, a);
    node(n).edges.clear();
    removed_[static_cast<std::size_t>(b)] = true;
  }

  static void reverse(SkeletonGraph::Edge& e) {
    std::ranges::reverse(e.points_mm);
    std::swap(e.nodes[0], e.nodes[1]);
  }

  // ---- bifurcations ----

  void merge_bifurcations() {
    for (int e = 0; e < edge_count(); ++e) {
      if (is_removed(e)) continue;
      const auto [a, b] = edge(e).nodes;
      if (a == b || node(a).edges.size() < 3 || node(b).edges.size() < 3) continue;
      if (length_mm(edge(e).points_mm) > 0.5 * std::min(radius_mm(a), radius_mm(b))) continue;
      remove(e);
      for (const int moved : node(b).edges) {
        SkeletonGraph::Edge& other = edge(moved);
        const bool starts_here = other.nodes[0] == b;
        other.nodes[starts_here ? 0 : 1] = a;
        (starts_here ? other.points_mm.front() : other.points_mm.back()) = node(a).position_mm;
        node(a).edges.push_back(moved);
      }
      node(b).edges.clear();
    }
  }

  SkeletonGraph remaining() const {
    SkeletonGraph kept;
    for (const SkeletonGraph::Node& n : graph_.nodes) kept.nodes.push_back({n.position_mm, {}});
    for (int e = 0; e < edge_count(); ++e) {
      if (is_removed(e)) continue;
      const SkeletonGraph::Edge& kept_edge = graph_.edges[static_cast<std::size_t>(e)];
      for (const int n : kept_edge.nodes)
        kept.nodes[static_cast<std::size_t>(n)].edges.push_back(static_cast<int>(kept.edges.size()));
      kept.edges.push_back(kept_edge);
    }
    return kept;
  }

  SkeletonGraph graph_;
  const Lumen& lumen_;
  double spur_mm_;
  std::vector<bool> removed_;
};

}  // namespace

SkeletonGraph prune(SkeletonGraph graph, const Lumen& lumen, double spur_vox) {
  return SkeletonPruner(std::move(graph), lumen, spur_vox).run();
}

SkeletonGraph without_leaves(SkeletonGraph graph, const std::vector<int>& leaves, const Lumen& lumen) {
  return SkeletonPruner(std::move(graph), lumen, 0).without(leaves);
}

}  // namespace xraycast
