#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <span>
#include <vector>

namespace xraycast {

enum class VesselnessMeasure { frangi, jerman };

/// The measure of a bright tube.
struct VesselnessOptions {
  VesselnessMeasure measure = VesselnessMeasure::jerman;
  std::vector<double> scales_mm = {0.8, 1.2, 1.8};  ///< standard deviations; about a vessel's radius
  double contrast_hu = 300;                         ///< of a vessel; much weaker structures count as noise
};

/// Multiscale vesselness of each voxel, 0 to 1, from the eigenvalues of the Hessian; the maximum over all
/// scales: Frangi et al., Multiscale vessel enhancement filtering, 1998, or Jerman et al., Enhancement of
/// vascular structures in 3D and 2D angiographic images, 2016, with the regularisation a fraction of
/// `contrast_hu` in place of the image's largest response, so that it does not depend on other structures in
/// the scan. Values beyond the grid are those of its border. Runs on the device by separable Gaussians. `hu`
/// is x fastest on the grid. Throws DeviceError.
std::vector<float> vesselness(std::span<const float> hu, const VolumeGeometry& grid,
                              const VesselnessOptions& options, ComputeDevice& device);

/// The same of a whole scan, slab by slab, so that the device holds only a part of it. A stage of `progress`.
std::vector<float> vesselness(const Volume& volume, const VesselnessOptions& options, ComputeDevice& device,
                              Progress& progress);

}  // namespace xraycast
