#include "xraycast/mask/skeleton_graph.hpp"

#include "xraycast/mask/components.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <unordered_map>

namespace xraycast {
namespace {

/// Walks along the lines of a skeleton from node to node.
class Tracer {
 public:
  explicit Tracer(const Mask& skeleton) : skeleton_(skeleton) {
    for (std::size_t i = 0; i < skeleton.voxels.size(); ++i)
      if (skeleton.voxels[i] != 0)
        voxels_.push_back(voxel_at(skeleton.geometry, static_cast<std::int64_t>(i)));
  }

  SkeletonGraph run() {
    make_nodes();
    for (const Index3& voxel : voxels_)
      if (const int node = node_at(voxel); node >= 0)
        for (const Index3& next : neighbours_in(skeleton_, voxel)) {
          const int other = node_at(next);
          if (other == node) continue;
          if (other >= 0) {
            if (node < other) add_edge(node, other, {});
          } else if (!walked_.contains(skeleton_.offset(next))) {
            follow(node, voxel, next);
          }
        }
    return std::move(graph_);
  }

 private:
  int node_at(const Index3& voxel) const {
    const auto found = node_of_.find(skeleton_.offset(voxel));
    return found == node_of_.end() ? -1 : found->second;
  }

  glm::dvec3 world_mm(const Index3& voxel) const { return skeleton_.geometry.to_world_mm(glm::dvec3(voxel)); }

  void make_nodes() {
    Mask junctions(skeleton_.geometry);
    for (const Index3& voxel : voxels_) {
      const std::size_t degree = neighbours_in(skeleton_, voxel).size();
      if (degree > 2) junctions[voxel] = 1;
      if (degree > 1) continue;
      node_of_[skeleton_.offset(voxel)] = static_cast<int>(graph_.nodes.size());
      graph_.nodes.push_back({world_mm(voxel), {}});
    }
    const Components clusters(junctions);
    const auto first = static_cast<int>(graph_.nodes.size());
    graph_.nodes.resize(graph_.nodes.size() + static_cast<std::size_t>(clusters.count()));
    for (const Components::Run& run : clusters.runs())
      for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
        const int node = first + run.component;
        node_of_[static_cast<std::size_t>(i)] = node;
        graph_.nodes[static_cast<std::size_t>(node)].position_mm +=
            world_mm(voxel_at(skeleton_.geometry, i)) / static_cast<double>(clusters.voxels(run.component));
      }
  }

  /// Follows a line from a node's voxel to the next node.
  void follow(int node, Index3 previous, Index3 voxel) {
    std::vector<glm::dvec3> inner_mm;
    int end = -1;
    while (end < 0) {
      walked_[skeleton_.offset(voxel)] = true;
      inner_mm.push_back(world_mm(voxel));
      Index3 next = voxel;
      for (const Index3& candidate :
           neighbours_in(skeleton_, voxel))  // two, of which one is where we come from
        if (candidate != previous && (inner_mm.size() > 1 || node_at(candidate) != node)) next = candidate;
      if (next == voxel) next = previous;  // back into the node from where it left
      end = node_at(next);
      previous = voxel;
      voxel = next;
      if (end < 0 && walked_.contains(skeleton_.offset(voxel))) return;
    }
    add_edge(node, end, inner_mm);
  }

  void add_edge(int a, int b, const std::vector<glm::dvec3>& inner_mm) {
    SkeletonGraph::Edge edge{{a, b}, {}};
    edge.points_mm.push_back(graph_.nodes[static_cast<std::size_t>(a)].position_mm);
    edge.points_mm.insert(edge.points_mm.end(), inner_mm.begin(), inner_mm.end());
    edge.points_mm.push_back(graph_.nodes[static_cast<std::size_t>(b)].position_mm);
    const auto self = static_cast<int>(graph_.edges.size());
    graph_.nodes[static_cast<std::size_t>(a)].edges.push_back(self);
    graph_.nodes[static_cast<std::size_t>(b)].edges.push_back(self);
    graph_.edges.push_back(std::move(edge));
  }

  const Mask& skeleton_;
  std::vector<Index3> voxels_;
  std::unordered_map<std::size_t, int> node_of_;
  std::unordered_map<std::size_t, bool> walked_;
  SkeletonGraph graph_;
};

/// A skeleton's voxel at which a link may begin.
struct LinkPoint {
  Index3 voxel;
  bool is_end;
  int face;  ///< of the scan, through which a vessel leaves here, or -1
};

/// A link and its weight: first by rank, then by cost.
struct RankedLink {
  int rank = std::numeric_limits<int>::max();
  double cost_mm = 0;
  ComponentLink link{};
  bool operator<(const RankedLink& other) const {
    return std::tie(rank, cost_mm) < std::tie(other.rank, other.cost_mm);
  }
};

/// The diagonal of a component's bounding box.
double extent_mm(const std::vector<LinkPoint>& component, const glm::dvec3& spacing_mm) {
  Index3 lower = component.front().voxel, upper = lower;
  for (const LinkPoint& p : component) lower = glm::min(lower, p.voxel), upper = glm::max(upper, p.voxel);
  return glm::length(spacing_mm * glm::dvec3(upper - lower));
}

RankedLink cheapest_link(const std::vector<LinkPoint>& from, const std::vector<LinkPoint>& to,
                         const glm::dvec3& spacing_mm) {
  const double longest_mm = std::max(extent_mm(from, spacing_mm), extent_mm(to, spacing_mm));
  RankedLink best;
  for (const LinkPoint& a : from) {
    check_cancelled();
    for (const LinkPoint& b : to) {
      const double mm = glm::length(spacing_mm * glm::dvec3(b.voxel - a.voxel));
      const bool is_beyond_scan = a.face >= 0 && a.face == b.face;
      if (!is_beyond_scan && mm > longest_mm) continue;
      const int sides = 1 + static_cast<int>(!a.is_end) + static_cast<int>(!b.is_end);
      const RankedLink ranked{
          is_beyond_scan ? 0 : 1, is_beyond_scan ? mm : mm * sides, {a.voxel, b.voxel, mm, is_beyond_scan}};
      if (ranked < best) best = ranked;
    }
  }
  return best;
}

int nearest_node(const SkeletonGraph& graph, const glm::dvec3& point_mm) {
  const auto away = [&](const SkeletonGraph::Node& node) {
    return glm::distance(node.position_mm, point_mm);
  };
  return static_cast<int>(std::ranges::min_element(graph.nodes, {}, away) - graph.nodes.begin());
}

}  // namespace

double length_mm(const std::vector<glm::dvec3>& points_mm) {
  double sum = 0;
  for (std::size_t i = 1; i < points_mm.size(); ++i) sum += glm::distance(points_mm[i - 1], points_mm[i]);
  return sum;
}

SkeletonGraph trace(const Mask& skeleton) { return Tracer(skeleton).run(); }

ComponentLinks link_components(Mask& skeleton, const std::function<int(const Index3&)>& face_of) {
  const Components components(skeleton);
  std::vector<std::vector<LinkPoint>> points(static_cast<std::size_t>(components.count()));
  for (const Components::Run& run : components.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
      const Index3 voxel = voxel_at(skeleton.geometry, i);
      const bool is_end = neighbours_in(skeleton, voxel).size() <= 1;
      points[static_cast<std::size_t>(run.component)].push_back(
          {voxel, is_end, is_end ? face_of(voxel) : -1});
    }
  std::ranges::sort(points, [](const auto& a, const auto& b) { return a.size() > b.size(); });

  // From the largest component on, always the one that is cheapest to link.
  std::vector<RankedLink> best(points.size());
  std::vector<std::size_t> unlinked(points.size());
  std::iota(unlinked.begin(), unlinked.end(), std::size_t{0});
  ComponentLinks result;
  for (std::size_t newest = 0; !unlinked.empty();) {
    std::erase(unlinked, newest);
    for (const std::size_t component : unlinked)
      best[component] = std::min(
          best[component], cheapest_link(points[newest], points[component], skeleton.geometry.spacing_mm));
    const auto next =
        std::ranges::min_element(unlinked, [&](std::size_t a, std::size_t b) { return best[a] < best[b]; });
    if (next == unlinked.end() || best[*next].rank == RankedLink{}.rank) break;
    newest = *next;
    result.links.push_back(best[newest].link);
  }
  for (const std::size_t component : unlinked)
    for (const LinkPoint& p : points[component]) skeleton[p.voxel] = 0;
  result.left_out = static_cast<int>(unlinked.size());
  return result;
}

void rasterise(const ComponentLink& link, Mask& skeleton) {
  const glm::dvec3 step(link.to - link.from);
  const int steps = static_cast<int>(std::max({std::abs(step.x), std::abs(step.y), std::abs(step.z)}));
  for (int k = 0; k < steps; ++k)
    skeleton[Index3(glm::round(glm::dvec3(link.from) + step * (static_cast<double>(k) / steps)))] = 1;
}

void add_edge(const ComponentLink& link, const VolumeGeometry& grid, SkeletonGraph& graph) {
  const int from = nearest_node(graph, grid.to_world_mm(glm::dvec3(link.from))),
            to = nearest_node(graph, grid.to_world_mm(glm::dvec3(link.to))),
            self = static_cast<int>(graph.edges.size());
  SkeletonGraph::Node &a = graph.nodes[static_cast<std::size_t>(from)],
                      &b = graph.nodes[static_cast<std::size_t>(to)];
  a.edges.push_back(self);
  b.edges.push_back(self);
  SkeletonGraph::Edge edge{{from, to}, {a.position_mm, b.position_mm}};
  edge.is_beyond_scan = true;
  graph.edges.push_back(std::move(edge));
}

}  // namespace xraycast
