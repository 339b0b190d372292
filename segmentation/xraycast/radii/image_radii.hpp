#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/scan_response.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/volume/volume.hpp"

#include <string>

namespace xraycast {

/// How a scan shows vessels.
struct ScanOfVessels {
  const Volume& volume;
  double noise_hu;  ///< standard deviation
  /// Of a scan that shows vessels alone, and whose values are cut off: its background is known.
  const ScanResponse* response = nullptr;
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
VesselTree with_image_radii(const VesselTree& tree, const ScanOfVessels& scan, const std::string& name,
                            Progress& progress);

/// The same; `shows_vessels_alone` says whether the scan shows nothing else bright.
VesselTree with_image_radii(const VesselTree& tree, const Volume& volume, double noise_hu,
                            bool shows_vessels_alone, const std::string& name, Progress& progress);

}  // namespace xraycast
