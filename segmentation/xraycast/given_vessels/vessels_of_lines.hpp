#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/centrelines/centreline_file.hpp"
#include "xraycast/given_vessels/given_vessels_options.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// The tree of centrelines, and as its surface the outer wall of tubes along them. Throws InputError, with
/// `name` in front, as tree_of_lines does.
Vessels vessels_of_lines(const std::vector<CentrelineLine>& lines, const GivenVesselsOptions& options,
                         const std::string& name, Progress& progress);

}  // namespace xraycast
