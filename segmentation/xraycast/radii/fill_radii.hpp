#pragma once

#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// Gives thin vessels the radii of circles as large as their lumen, so that a tree has the volume of its
/// fill. Each voxel's lumen goes to the nearest point of the tree, its distance less the point's radius; the
/// lumen of a few points is divided by the length that they stand for. A mask's wall says little of vessels
/// that fill no voxel. Vessels of more than a voxel's radius keep the radii that they have where the mask
/// holds half full voxels, and those of more than 4.5 where it holds all that lumen touches; over a voxel
/// more the radius changes from one to the other.
void radii_from_fill(const LumenFill& fill, std::vector<VesselBranch>& branches);

}  // namespace xraycast
