#pragma once

#include "xraycast/volume/volume.hpp"

namespace xraycast {

/// A volume of means over blocks of so many voxels, rounded towards 0, on all cores; an axis shorter than a
/// block makes one voxel of it. What does not fill a block is left out.
Volume block_means(const Volume& volume, const Index3& block);

}  // namespace xraycast
