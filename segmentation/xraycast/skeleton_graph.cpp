#include "xraycast/skeleton_graph.hpp"

#include "xraycast/components.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

namespace xraycast {
namespace {

/// The voxels of a skeleton and the way through them.
class Tracer {
 public:
  explicit Tracer(const Mask& skeleton) : skeleton_(skeleton) {
    for (std::size_t i = 0; i < skeleton.voxels.size(); ++i)
      if (skeleton.voxels[i] != 0) voxels_.push_back(index_of(i));
  }

  SkeletonGraph run() {
    make_nodes();
    for (const Index3& voxel : voxels_)
      if (const int node = node_at(voxel); node >= 0)
        for (const Index3& next : neighbours(voxel)) {
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
  Index3 index_of(std::size_t offset) const {
    const auto o = static_cast<std::int64_t>(offset);
    const Index3 size = skeleton_.geometry.size;
    return {o % size.x, o / size.x % size.y, o / (size.x * size.y)};
  }

  std::vector<Index3> neighbours(const Index3& voxel) const {
    std::vector<Index3> list;
    for (const Index3& step : kNeighbours)
      if (skeleton_.at(voxel + step)) list.push_back(voxel + step);
    return list;
  }

  int node_at(const Index3& voxel) const {
    const auto found = node_of_.find(skeleton_.offset(voxel));
    return found == node_of_.end() ? -1 : found->second;
  }

  glm::dvec3 world_mm(const Index3& voxel) const { return skeleton_.geometry.to_world_mm(glm::dvec3(voxel)); }

  void make_nodes() {
    Mask meetings(skeleton_.geometry);
    for (const Index3& voxel : voxels_) {
      const std::size_t degree = neighbours(voxel).size();
      if (degree > 2) meetings[voxel] = 1;
      if (degree > 1) continue;
      node_of_[skeleton_.offset(voxel)] = static_cast<int>(graph_.nodes.size());
      graph_.nodes.push_back({world_mm(voxel), {}});
    }
    const Components clusters(meetings);
    const auto first = static_cast<int>(graph_.nodes.size());
    graph_.nodes.resize(graph_.nodes.size() + static_cast<std::size_t>(clusters.count()));
    for (const Components::Run& run : clusters.runs())
      for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
        const int node = first + run.component;
        node_of_[static_cast<std::size_t>(i)] = node;
        graph_.nodes[static_cast<std::size_t>(node)].position_mm +=
            world_mm(index_of(static_cast<std::size_t>(i))) /
            static_cast<double>(clusters.voxels(run.component));
      }
  }

  /// Walks a line from a node's voxel to the next node.
  void follow(int node, Index3 previous, Index3 voxel) {
    std::vector<glm::dvec3> inner_mm;
    int end = -1;
    while (end < 0) {
      walked_[skeleton_.offset(voxel)] = true;
      inner_mm.push_back(world_mm(voxel));
      Index3 next = voxel;
      for (const Index3& candidate : neighbours(voxel))  // two, of which one is where we come from
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

}  // namespace

SkeletonGraph trace(const Mask& skeleton) { return Tracer(skeleton).run(); }

std::vector<double> join_parts(Mask& skeleton) {
  const Components parts(skeleton);
  std::vector<std::vector<Index3>> voxels(static_cast<std::size_t>(parts.count()));
  const Index3 size = skeleton.geometry.size;
  for (const Components::Run& run : parts.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i)
      voxels[static_cast<std::size_t>(run.component)].push_back(
          {i % size.x, i / size.x % size.y, i / (size.x * size.y)});
  std::ranges::sort(voxels, [](const auto& a, const auto& b) { return a.size() > b.size(); });

  std::vector<double> lengths_mm;
  for (std::size_t part = 1; part < voxels.size(); ++part) {
    double nearest_mm = std::numeric_limits<double>::infinity();
    Index3 from{}, to{};
    for (const Index3& a : voxels[part])
      for (const Index3& b : voxels[0]) {
        const double mm = glm::length(skeleton.geometry.spacing_mm * glm::dvec3(b - a));
        if (mm < nearest_mm) nearest_mm = mm, from = a, to = b;
      }
    const glm::dvec3 step(to - from);
    const int steps = static_cast<int>(std::max({std::abs(step.x), std::abs(step.y), std::abs(step.z)}));
    for (int k = 0; k < steps; ++k) {
      const Index3 voxel(glm::round(glm::dvec3(from) + step * (static_cast<double>(k) / steps)));
      skeleton[voxel] = 1;
      voxels[0].push_back(voxel);
    }
    voxels[0].insert(voxels[0].end(), voxels[part].begin(), voxels[part].end());
    lengths_mm.push_back(nearest_mm);
  }
  return lengths_mm;
}

}  // namespace xraycast
