#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"

#include <string>

namespace xraycast {

/// A scan and how it shows vessels.
struct ScanOfTree {
  const Volume& volume;
  double noise_hu;           ///< standard deviation
  bool shows_vessels_alone;  ///< nothing else is bright
};

/// Gives a tree the radii that its scan shows (with_image_radii).
VesselTree measured_tree(const VesselTree& tree, const ScanOfTree& scan, const std::string& name,
                         Progress& progress);

/// The same in place, and follows its vessels beyond their ends (with_longer_ends), in its mask and fill too.
/// False where no vessel goes on: then only radii change.
bool measure_and_follow(VesselTree& tree, Mask& mask, LumenFill& fill, const ScanOfTree& scan,
                        const std::string& name, Progress& progress);

}  // namespace xraycast
