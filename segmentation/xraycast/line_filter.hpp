#pragma once

#include "xraycast/device.hpp"
#include "xraycast/volume.hpp"

#include <optional>

namespace xraycast {

/// A scan with less noise, or nothing where the scan is good enough for thresholds as it is. By the ratio of
/// noise to the spread of its values: moderate noise is smoothed by a Gaussian of 0.7 voxels; in heavy noise
/// every voxel becomes the largest of the means along lines through it, over 64 directions, so that a thin
/// vessel is averaged along itself and not with what lies around it.
std::optional<Volume> denoised(const Volume& volume, Device& device);

}  // namespace xraycast
