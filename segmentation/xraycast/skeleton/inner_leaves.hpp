#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/skeleton_graph.hpp"

#include <vector>

namespace xraycast {

/// The leaves of a graph that are no vessels: with all its points such a one lies within the lumen of the
/// edges that it leaves, where their radius is `wide_mm` or more, or less than `margin_mm` out of it. Noise
/// that pits the wall of a wide vessel makes them. `lines` are the edges' centrelines with radii, from first
/// node to second. Of the leaves of one node only the one that reaches the least far out is named, since the
/// others may be the vessel that it lies in.
std::vector<int> inner_leaves(const SkeletonGraph& graph, const std::vector<std::vector<VesselPoint>>& lines,
                              double margin_mm, double wide_mm);

}  // namespace xraycast
