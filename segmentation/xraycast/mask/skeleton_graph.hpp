#pragma once

#include "xraycast/mask/mask.hpp"

#include <glm/vec3.hpp>

#include <array>
#include <functional>
#include <vector>

namespace xraycast {

/// Lines one voxel wide as a graph: nodes where lines meet or end, and edges between them.
struct SkeletonGraph {
  struct Node {
    glm::dvec3 position_mm{0, 0, 0};
    std::vector<int> edges;  ///< an edge that returns to its node is named twice
  };
  struct Edge {
    std::array<int, 2> nodes;
    std::vector<glm::dvec3> points_mm;  ///< from the first node to the second, both included
    bool closes_loop = false;           ///< it closed a cycle, and was cut open at its second node
    bool is_beyond_scan = false;        ///< a link for two vessels that join beyond the scan
  };
  std::vector<Node> nodes;
  std::vector<Edge> edges;
};

/// Length of a polyline.
double length_mm(const std::vector<glm::dvec3>& points_mm);

/// The graph of a thinned mask. Adjacent voxels that each have three or more neighbours are one node. Closed
/// rings without a node are left out.
SkeletonGraph trace(const Mask& skeleton);

/// A straight line between two components of a skeleton.
struct ComponentLink {
  Index3 from, to;
  double length_mm;
  bool is_beyond_scan;  ///< both ends leave the scan through one face, so that the vessels join beyond it
};

struct ComponentLinks {
  std::vector<ComponentLink> links;
  int left_out;  ///< number of components without a link
};

/// The lines that link the components of a skeleton to its largest one: their minimum spanning tree (Prim,
/// Shortest connection networks and some generalizations, 1957). Ends that leave the scan through the same
/// face come first, then others by length; a link's length counts twice where one of its points is not an
/// end, and three times where neither is, because an interrupted vessel has two ends. Within the scan no line
/// is longer than the longer of the components that it links; components without a link are removed from the
/// skeleton. `face_of` returns the face of the scan through which a vessel that ends in a voxel leaves, or
/// -1.
ComponentLinks link_components(Mask& skeleton, const std::function<int(const Index3&)>& face_of);

/// Draws a link as a line of voxels.
void rasterise(const ComponentLink& link, Mask& skeleton);

/// Adds a link to a graph, as an edge between the nodes at its two points.
void add_edge(const ComponentLink& link, const VolumeGeometry& grid, SkeletonGraph& graph);

}  // namespace xraycast
