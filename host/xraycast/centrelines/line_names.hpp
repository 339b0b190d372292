#pragma once

#include "xraycast/centrelines/centreline_file.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// A tree that was made of lines, with their names: a branch has a name if all lines that run along it and
/// have one have the same, so that what lines to several vessels share has none.
VesselTree with_names_of_lines(const VesselTree& tree, const std::vector<CentrelineLine>& lines);

}  // namespace xraycast
