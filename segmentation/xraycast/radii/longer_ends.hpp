#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/radii/lumen_brightness.hpp"
#include "xraycast/radii/tube_questions.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// A tree whose vessels go on beyond the free ends that they had.
struct LongerEnds {
  VesselTree tree;
  std::vector<std::vector<VesselPoint>> followed;  ///< the lines that are new, each from within its vessel
};

/// Follows vessels beyond the free ends of a tree, where a mask has lost them: along an organ that is nearly
/// as bright, where they become too thin for a threshold, or where they swell into what they touch. A tube of
/// the vessel's radius and brightness is fitted to the scan (fit_tube) a voxel farther on each time, from
/// some voxels before the end: where the mask has swollen, from farther back. A vessel goes on while the tube
/// is about as wide as before, hardly off the way, darker on all sides, as even as noise allows, and shows at
/// least half of its contrast in what lies ahead, by five deviations of the noise; three voxels without are
/// passed. It ends at other branches, at the scan's side, and after 60 mm.
///
/// Vessels of more than six voxels' radius are not followed: a mask does not lose them. Lines of ends that
/// nothing follows stay as they are. A unit of `progress`. `name` is the tree's.
LongerEnds with_longer_ends(const VesselTree& tree, const ScanOfVessels& scan,
                            const LumenBrightness& brightness, const std::string& name, Progress& progress);

}  // namespace xraycast
