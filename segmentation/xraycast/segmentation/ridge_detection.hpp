#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <vector>

namespace xraycast {

/// Whether a scan's whole range is ten standard deviations of its noise or less, so that the distributions of
/// background and lumen overlap (four above the one, four below the other) and only averaging along vessels
/// separates them.
bool is_dominated_by_noise(const Volume& volume);

/// Ridge strength of each voxel, in the scan's unit, by oriented line integrals: a difference of Gaussians of
/// 0.5 and 3 voxels, averaged along seven voxels to both sides, of which the weaker counts; the largest over
/// 64 directions. A structure bright on one side only is not a ridge, so that vessels have no halo and are
/// not prolonged. Throws DeviceError.
std::vector<float> ridge_strength(const Volume& volume, ComputeDevice& device);

/// Thin vessels by hysteresis thresholds of their ridge strength on this grid, in standard deviations above
/// the background: strong is 4.25, in components of five voxels or more; weak components of 3 count where
/// they join two strong ones, but not as dead ends. Components without a strong part of 14 voxels, the length
/// of the filter's line, are removed: in noise alone the largest has nine.
Mask detect_ridges(const std::vector<float>& strength, const VolumeGeometry& grid);

/// The local contrast-to-noise ratio of each voxel: a difference of Gaussians of `across_vox` and 3 voxels,
/// in standard deviations of the background. Throws DeviceError.
std::vector<float> contrast_to_noise(const Volume& volume, double across_vox, ComputeDevice& device);

/// The lumen around `ridges`: their skeleton, and of their voxels and those that share a face or an edge with
/// one, those whose `contrast` (contrast_to_noise, of 0.8 voxels) is 13.3 % of the largest or more. That is
/// half the contrast of a lumen one voxel wide, which has a quarter of that of five voxels. The threshold
/// does not depend on the noise, so that vessels are neither wider nor thinner in more noise: in noise of 50
/// to 75 the volume of grown trees is right to three per cent. Spurs whose mean contrast is less than 2.5 are
/// pruned, with the voxels nearer to them than to the rest: in noise of 75 the last of these follow vessels
/// as often as noise.
Mask recover_lumen(const Mask& ridges, const std::vector<float>& contrast);

}  // namespace xraycast
