#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/scan/volume.hpp"

namespace xraycast {

/// The body without what lies beside it, such as the table, its rails, clothes and tubes: what is above
/// -300 HU, opened by 10 mm in each slice so that thin shells drop off, in parts of at least a fiftieth of
/// the largest one, so that arms and legs beside the trunk stay. What a part has on three sides of it or more
/// in a slice belongs to it: lungs too, even where the scan's border cuts them; and what lies within 5 mm of
/// it, such as an ear's artery. Everything, where nothing is as thick as the opening.
Mask find_body(const Volume& volume);

}  // namespace xraycast
