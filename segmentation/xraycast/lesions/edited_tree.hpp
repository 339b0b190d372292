#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/lesions/edited_surface.hpp"

#include <vector>

namespace xraycast {

/// The tree without branches, whose descendants are removed too. Others keep their order.
VesselTree without_branches(const VesselTree& tree, const std::vector<bool>& is_removed);

/// A tree with an aneurysm, and its branch.
struct TreeWithSac {
  VesselTree tree;
  int branch;
};

/// The tree with a ball's dead end, last of its branches. The vessel splits there; its part behind that,
/// which is the last but one then, keeps its name and its children. Radii are those of spheres within the
/// ball, and in the neck no wider than half of the vessel.
TreeWithSac with_sac(const VesselTree& tree, const SacBall& ball, double neck_mm);

/// The tree with all lengths times a factor, about its root's start.
VesselTree scaled(const VesselTree& tree, double factor);

}  // namespace xraycast
