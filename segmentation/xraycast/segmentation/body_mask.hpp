#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

namespace xraycast {

/// The body without what lies beside it, such as the table, its rails, clothes and tubes: what is above
/// -300 HU, after a morphological opening by 10 mm in each slice that removes thin shells, in components of
/// at least a fiftieth of the largest one, so that arms and legs beside the trunk stay. What a component has
/// on three sides or more in a slice belongs to it: lungs too, even where the scan's border cuts them; and
/// what lies within 5 mm of it, such as an ear's artery. The whole grid, where nothing is as thick as the
/// opening.
Mask find_body_mask(const Volume& volume);

}  // namespace xraycast
