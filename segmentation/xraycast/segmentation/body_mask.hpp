#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

namespace xraycast {

/// The body without the table, its rails, clothes and tubes: all voxels above -300 HU, after a morphological
/// opening by 10 mm in each slice that removes thin shells, in components of at least a fiftieth of the
/// largest one, so that arms and legs beside the trunk are kept. Voxels enclosed by a component on at least
/// three sides in a slice are added, such as lungs, even where the scan's border cuts them; and so are voxels
/// within 5 mm of it, such as the arteries of an ear. The whole grid if nothing is as thick as the opening.
Mask find_body_mask(const Volume& volume);

}  // namespace xraycast
