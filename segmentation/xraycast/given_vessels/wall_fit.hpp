#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// Moves the lines of a tree across their direction, and changes its radii, so that its tubes touch a wall:
/// the squared distances of the wall's points from the nearest tube become least. Free ends move along them,
/// to a radius from the wall that closes them. What lies within another vessel, of which the wall tells
/// nothing, stays.
///
/// Gauss-Newton: each point of a line takes the step that fits the wall within about a radius of it best; a
/// junction's place that of all branches that meet there. `branches` are those of a tree, with children.
void fit_to_wall(std::vector<VesselBranch>& branches, const Mesh& wall);

}  // namespace xraycast
