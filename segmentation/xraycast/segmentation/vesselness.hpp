#pragma once

#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/scan/volume.hpp"

#include <span>
#include <vector>

namespace xraycast {

enum class VesselnessMeasure { frangi, jerman };

/// How tubular bright structures are told.
struct VesselnessOptions {
  VesselnessMeasure measure = VesselnessMeasure::jerman;
  std::vector<double> scales_mm = {0.8, 1.2, 1.8};  ///< standard deviations; about a vessel's radius
  double contrast_hu = 300;                         ///< of a vessel; structures much weaker are noise
};

/// For each voxel 0 to 1, the largest over all scales: Frangi et al., Multiscale vessel enhancement
/// filtering, 1998, or Jerman et al., Enhancement of vascular structures in 3D and 2D angiographic images,
/// 2016, with the regularisation a share of `contrast_hu` in place of the image's largest response, so that
/// it does not depend on what else is in the scan. Values beyond the grid are those of its border. Runs on
/// the device by separable Gaussians. `hu` is x fastest on the grid.
std::vector<float> vesselness(std::span<const float> hu, const VolumeGeometry& grid,
                              const VesselnessOptions& options, ComputeDevice& device);

}  // namespace xraycast
