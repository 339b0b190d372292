#pragma once

#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// Parts two systems of vessels that touch: of those components of a mask that hold points of both, the
/// voxels that belong to `others` rather than to `own`. Every stretch of a vessel has a maximum of the
/// distance from the wall, and meets its neighbours at necks: in the course of a vessel nearly as wide as the
/// narrower one of both sides, and narrower where two vessels only touch. Stretches are joined in the order
/// of their necks' relative width, the widest first, but never one of `own` with one of `others` (a spanning
/// forest from markers: Meyer, Minimum spanning forests for morphological segmentation, 1994). Points lie in
/// the mask; `others` in stretches of more than `max_radius_mm` lie in no vessel, and count for nothing.
Mask touching_system(const Mask& mask, const std::vector<Index3>& own, const std::vector<Index3>& others,
                     double max_radius_mm);

}  // namespace xraycast
