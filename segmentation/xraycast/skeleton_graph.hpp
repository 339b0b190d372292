#pragma once

#include "xraycast/mask.hpp"

#include <glm/vec3.hpp>

#include <array>
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
  };
  std::vector<Node> nodes;
  std::vector<Edge> edges;
};

/// Reads a thinned mask as a graph. Neighbouring voxels that each have three or more neighbours are one node.
/// Closed rings without a node are passed over.
SkeletonGraph trace(const Mask& skeleton);

/// Joins the parts of a skeleton by straight lines of voxels between those that are nearest to each other.
/// Returns the lines' lengths in mm.
std::vector<double> join_parts(Mask& skeleton);

}  // namespace xraycast
