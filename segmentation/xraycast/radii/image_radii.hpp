#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/radii/lumen_brightness.hpp"
#include "xraycast/radii/tube_questions.hpp"

#include <optional>
#include <string>

namespace xraycast {

/// A tree with the radii that its scan shows, and how the scan shows it.
struct MeasuredTree {
  VesselTree tree;
  std::optional<LumenBrightness> brightness;  ///< nothing where it cannot be told; radii stay then
};

/// A tree with the radii that its scan shows: at each place the radius of the round lumen which, blurred as
/// the scan is, explains the voxels about it best (tube_fit), in the least squares' sense. A blurred wall is
/// half as bright as the lumen within it where it is flat, farther inside the more it is curved, and a thin
/// vessel's middle never gets as bright as its lumen: so the scan's blur is measured first, as that with
/// which pieces of all vessels are explained best, then the lumen's CT number on each piece, held to that of
/// the others where a thin vessel tells little. Lines stay as they are.
///
/// A radius stays too where the scan does not show one round vessel: without contrast, beside bone, in
/// vessels of more than 20 voxels' radius, where the given one changes much within a few voxels, across
/// slices of more than twice the pixels' size, and where what is found differs by more than half a voxel and
/// a third; and everywhere in scans blurred by two voxels. Within 15 voxels of a radius that was found it
/// changes by as much, less the farther away it is. Three units of `progress`. `name` is the tree's.
MeasuredTree with_image_radii(const VesselTree& tree, const ScanOfVessels& scan, const std::string& name,
                              Progress& progress);

}  // namespace xraycast
