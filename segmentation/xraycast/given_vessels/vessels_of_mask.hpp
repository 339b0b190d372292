#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/given_vessels/given_vessels_options.hpp"
#include "xraycast/given_vessels/labelled_mask.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <string>

namespace xraycast {

/// The tree and the surface of a mask on its own grid, which is the scan's where one is given. Without a scan
/// voxels are full or empty; `scan` says how full those at the wall are. Branches have the names of
/// structures. Throws InputError, with `name` in front, for a mask on another grid than the scan's, and as
/// extract_centrelines does.
Vessels vessels_of_mask(LabelledMask labelled, const Volume* scan, const GivenVesselsOptions& options,
                        const std::string& name, Progress& progress);

}  // namespace xraycast
