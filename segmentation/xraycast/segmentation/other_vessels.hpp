#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <string>

namespace xraycast {

/// Takes vessels that hold a point to exclude, and that touch those of a seed, off a mask (touching_system),
/// and their points off the markers: what is left of a vessel beside such a point is the seeds'. Points in
/// wider structures stay. Returns what was taken off; nothing where there are no points of both kinds.
Mask take_off_other_vessels(Mask& mask, Markers& markers, const std::string& name);

}  // namespace xraycast
