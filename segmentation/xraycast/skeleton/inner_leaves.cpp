#include "xraycast/skeleton/inner_leaves.hpp"

#include "xraycast/evidence/place_in_tube.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>

namespace xraycast {
namespace {

/// How far a point lies out of a line's lumen where that is wide; negative within.
double out_of_lumen_mm(const glm::dvec3& point_mm, const std::vector<VesselPoint>& line, double wide_mm) {
  double least_mm = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < line.size(); ++i) {
    const VesselPoint &a = line[i - 1], &b = line[i];
    if (std::max(a.radius_mm, b.radius_mm) >= wide_mm)
      least_mm = std::min(least_mm, place_in_tube(point_mm, a, b).out_mm());
  }
  return least_mm;
}

/// The other edges at a node, and those beyond the short ones among them.
std::vector<int> edges_around(const SkeletonGraph& graph, int node, int but) {
  std::vector<int> found;
  const auto add = [&](int n) {
    for (const int e : graph.nodes[static_cast<std::size_t>(n)].edges)
      if (e != but && !graph.edges[static_cast<std::size_t>(e)].is_beyond_scan &&
          !std::ranges::count(found, e))
        found.push_back(e);
  };
  add(node);
  const std::vector<int> at_node = found;
  for (const int e : at_node)
    for (const int n : graph.edges[static_cast<std::size_t>(e)].nodes) add(n);
  return found;
}

}  // namespace

std::vector<int> inner_leaves(const SkeletonGraph& graph, const std::vector<std::vector<VesselPoint>>& lines,
                              double margin_mm, double wide_mm) {
  struct Leaf {
    int edge;
    double out_mm;
  };
  std::map<int, Leaf> of_nodes;
  const auto is_end = [&](int n) { return graph.nodes[static_cast<std::size_t>(n)].edges.size() == 1; };
  for (int e = 0; e < static_cast<int>(graph.edges.size()); ++e) {
    const SkeletonGraph::Edge& edge = graph.edges[static_cast<std::size_t>(e)];
    if (edge.is_beyond_scan || is_end(edge.nodes[0]) == is_end(edge.nodes[1])) continue;
    const int fork = is_end(edge.nodes[0]) ? edge.nodes[1] : edge.nodes[0];
    const std::vector<int> around = edges_around(graph, fork, e);
    double out_mm = -std::numeric_limits<double>::infinity();
    // Thinning shortens one tip, and the last inscribed sphere another.
    std::vector<glm::dvec3> points_mm = edge.points_mm;
    std::ranges::transform(lines[static_cast<std::size_t>(e)], std::back_inserter(points_mm),
                           &VesselPoint::position_mm);
    for (const glm::dvec3& point_mm : points_mm) {
      double least_mm = std::numeric_limits<double>::infinity();
      for (const int other : around)
        least_mm =
            std::min(least_mm, out_of_lumen_mm(point_mm, lines[static_cast<std::size_t>(other)], wide_mm));
      out_mm = std::max(out_mm, least_mm);
      if (out_mm >= margin_mm) break;
    }
    if (out_mm >= margin_mm) continue;
    const auto [at, is_first] = of_nodes.try_emplace(fork, Leaf{e, out_mm});
    if (!is_first && out_mm < at->second.out_mm) at->second = {e, out_mm};
  }
  std::vector<int> leaves;
  for (const auto& [node, leaf] : of_nodes) leaves.push_back(leaf.edge);
  return leaves;
}

}  // namespace xraycast
