#pragma once

#include "xraycast/device.hpp"
#include "xraycast/volume.hpp"

#include <optional>

namespace xraycast {

/// A scan smoothed by a Gaussian of 0.7 voxels, or nothing where its noise is low enough for thresholds as it
/// is.
std::optional<Volume> denoised(const Volume& volume, Device& device);

}  // namespace xraycast
