#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <cstdint>

namespace xraycast {

/// A tree as arteries have it, by a seed: a trunk of 4 to 8 mm in radius that bends, tapers, gives off side
/// branches and splits, three to four times over; radii follow Murray's law (a parent's cube is the sum of
/// its children's) down to 1.2 mm. Branches leave at 35 degrees or more, are longer than they and their
/// parents are wide, and keep a millimetre clear of all that they do not come from. 5 to 25 branches. The
/// same on every machine.
VesselTree branching_tree(std::uint32_t seed);

}  // namespace xraycast
