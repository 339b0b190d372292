#pragma once

#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// Adds the lumen of tubes along lines to a mask and its fill, both on one grid.
void add_lumen_of_lines(const std::vector<std::vector<VesselPoint>>& lines, Mask& mask, LumenFill& fill);

}  // namespace xraycast
