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

/// Follows vessels beyond the ends of a tree's leaves, where a mask has lost them: along an organ that is
/// nearly as bright, or where it has swollen into what it touches. A tube of the vessel's radius and of the
/// vessels' usual brightness is fitted to the scan (fit_tube), a voxel farther on each time, from some voxels
/// before the end, or from farther back where it is not found there. A vessel goes on while the tube
/// - is about as wide as before, and hardly off the way,
/// - is brighter than what is on each side of it,
/// - explains its voxels as far as noise allows,
/// - and shows half of its contrast in what lies ahead, by five deviations of the noise.
/// Two voxels without are passed. It ends at what is in the tree, at the scan's side, and after 60 mm.
///
/// Ends stay where a vessel goes on by less than four voxels, those of vessels of more than six voxels'
/// radius, which a mask does not lose, and those across slices of more than twice the pixels' size; so does
/// the root. A unit of `progress`. `name` is the tree's.
LongerEnds with_longer_ends(const VesselTree& tree, const ScanOfVessels& scan,
                            const LumenBrightness& brightness, const std::string& name, Progress& progress);

}  // namespace xraycast
