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
    bool closes_loop = false;           ///< it ran back to where other edges lead too, and was cut open there
    bool is_outside = false;            ///< it stands for what joins two vessels beyond the scan
  };
  std::vector<Node> nodes;
  std::vector<Edge> edges;
};

/// Reads a thinned mask as a graph. Neighbouring voxels that each have three or more neighbours are one node.
/// Closed rings without a node are passed over.
SkeletonGraph trace(const Mask& skeleton);

/// A straight line between two parts of a skeleton.
struct PartJoin {
  Index3 from, to;
  double length_mm;
  bool is_outside;  ///< both ends leave the scan through one face, so that the vessels join beyond it
};

struct PartJoins {
  std::vector<PartJoin> joins;
  int left_out;  ///< parts that nothing joins
};

/// The lines that join the parts of a skeleton to its largest one, the cheapest first. Ends that leave the
/// scan through the same face come first, then others by their length; it counts twice where one side is no
/// end, and three times where both are none, because a vessel that was interrupted has two ends. No line but
/// beyond the scan is longer than the longer of the parts that it joins; parts without one are taken off the
/// skeleton. `face_of` names the face of the scan through which a vessel leaves that ends in a voxel, or
/// gives -1.
PartJoins join_parts(Mask& skeleton, const std::function<int(const Index3&)>& face_of);

/// Draws a join as a line of voxels.
void draw(const PartJoin& join, Mask& skeleton);

/// Adds a join to a graph, as an edge between the two nodes that lie there.
void add_edge(const PartJoin& join, const VolumeGeometry& grid, SkeletonGraph& graph);

}  // namespace xraycast
