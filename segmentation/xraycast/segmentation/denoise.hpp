#pragma once

#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <optional>

namespace xraycast {

/// A scan smoothed by a Gaussian of 0.7 voxels; nothing if its noise is low enough for thresholds. Throws
/// DeviceError.
std::optional<Volume> denoised(const Volume& volume, ComputeDevice& device);

/// A scan smoothed by a Gaussian, in whole HU again. Throws DeviceError.
Volume smoothed_scan(const Volume& volume, const glm::dvec3& sigma_vox, ComputeDevice& device);

}  // namespace xraycast
