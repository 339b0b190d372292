#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// Removes branches that end within the lumen of those that they leave: no vessel, but what is left of a
/// skeleton in a wide one. Where one child is left, it and its parent become one branch. `children` are those
/// of VesselTree, and are not kept up.
void remove_inner_branches(std::vector<VesselBranch>& branches);

}  // namespace xraycast
