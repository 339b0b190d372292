#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <vector>

namespace xraycast {

/// Ridge strength of each voxel, in the scan's unit, by oriented line integrals: a difference of Gaussians of
/// 0.5 and 3 voxels, averaged along seven voxels to both sides, of which the weaker counts; the largest over
/// 64 directions. A structure bright on one side only is not a ridge, so that vessels have no halo and are
/// not prolonged. It is 0 where nothing around rises by a hundredth of the scan's range. Throws
/// DeviceError.
std::vector<float> ridge_strength(const Volume& volume, ComputeDevice& device);

/// The least strength of a certain ridge in a scan's noise: 4.25 standard deviations above the median, of the
/// voxels where lines were tried. In a scan that was masked those lie around what the mask has left.
double strong_ridge(const std::vector<float>& strength);

/// Thin vessels by hysteresis thresholds of their ridge strength on this grid. Strong is 4.25 standard
/// deviations above the background (strong_ridge), and `least` or more, in components of five voxels or more;
/// weak components of three standard deviations and 70 % of `least` count where they join two strong ones,
/// but not as dead ends. Components without a strong part of 14 voxels, the length of the filter's line, are
/// removed: in four million voxels of noise alone the largest has eleven.
Mask detect_ridges(const std::vector<float>& strength, const VolumeGeometry& grid, double least);

/// The least unit of contrast-to-noise ratios where there is hardly any noise: with it a ratio of two, at
/// which vessels are followed, is 4 % of the lumen's contrast.
inline double least_unit_hu(double lumen_hu) { return 0.02 * lumen_hu; }

/// The local contrast-to-noise ratio of each voxel: a difference of Gaussians of `across_vox` and 3 voxels,
/// in standard deviations of the background, of `least_unit_hu` or more. Throws DeviceError.
std::vector<float> contrast_to_noise(const Volume& volume, double across_vox, ComputeDevice& device,
                                     double least_unit_hu = 0);

/// The components of a mask that have so many voxels.
Mask large_components(const Mask& mask, std::int64_t min_voxels);

/// `strong` with the components of `weak` that touch two of its own or more.
Mask with_weak_links(const Mask& strong, const Mask& weak);

/// A skeleton, and what was pruned of it.
struct PrunedSkeleton {
  Mask kept, pruned;
};

/// The skeleton of vessels without the spurs whose mean `contrast` (contrast_to_noise, of 0.8 voxels) is less
/// than 2.5: in noise of 75 the last of these follow vessels as often as noise.
PrunedSkeleton pruned_skeleton(const Mask& vessels, const std::vector<float>& contrast);

}  // namespace xraycast
