#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/skeleton/lumen.hpp"

#include <vector>

namespace xraycast {

/// Lets side branches begin on the axis of the vessel that they leave. A skeleton bends towards a side branch
/// where both share their lumen; here the vessel passes smoothly, in the middle of `lumen` where that is
/// given, and the branch comes straight from its axis in the direction that it has outside. Where no child
/// continues its parent, as at the end of the aorta, or a branch is too short to tell its direction, the
/// lines stay.
void straighten_junctions(std::vector<VesselBranch>& branches, const Lumen* lumen = nullptr);

}  // namespace xraycast
