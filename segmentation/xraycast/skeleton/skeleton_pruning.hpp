#pragma once

#include "xraycast/mask/skeleton_graph.hpp"
#include "xraycast/skeleton/lumen.hpp"

#include <vector>

namespace xraycast {

/// The forest of centrelines in a skeleton's graph:
/// - of every cycle the thinnest edge is cut open a voxel before its second node, where it is marked
///   `closes_loop`; an edge shorter than the lumen's circumference, or than that of a hole of two voxels'
///   radius, only surrounds a hole in the mask, and is removed (maximum spanning forest by thickness:
///   Kruskal, On the shortest spanning subtree of a graph, 1956);
/// - spurs, which are leaves whose tip reaches less than `spur_vox` voxels out of the sphere inscribed at
///   their origin, are removed, the shortest first: so much voxels cannot tell; the tip of a vessel that goes
///   on beyond the scan is where it leaves that;
/// - bifurcations within half a radius of each other are merged into one with more than two branches.
SkeletonGraph prune(SkeletonGraph graph, const Lumen& lumen, double spur_vox = 2);

/// A graph without leaves that lie within another lumen; what forked where they left is one edge now, and
/// closes no loop.
SkeletonGraph without_leaves(SkeletonGraph graph, const std::vector<int>& leaves, const Lumen& lumen);

}  // namespace xraycast
