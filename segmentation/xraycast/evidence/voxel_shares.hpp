#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

#include <vector>

namespace xraycast {

/// What the values of voxels say of the lumen in them, x fastest; zero where nothing was asked.
struct VoxelShares {
  std::vector<float> probability;  ///< that lumen fills a fourteenth of the voxel or more
  std::vector<float> fraction;     ///< the expected fraction of lumen
  /// Of the voxels that hold lumen, the expected share that it fills by less than seven tenths: a half and
  /// more where thin vessels have partial volume, almost none where voxels are either full or empty.
  double partial = 0;
};

/// The contrast of a full voxel, the noise's standard deviation, and the background.
struct VoxelScale {
  double lumen_hu, noise_hu, background_hu;
};

/// Estimates the lumen in the voxels of `reach`, a mask on `volume`'s grid, from each one's own value: no
/// smoothing widens a vessel. How likely each fraction is, before its value is known, depends on the voxel's
/// neighbours (a Gaussian of one voxel, and the strongest line through it, both without the voxel
/// itself): voxels are parted into classes of like neighbours, and the fractions' distribution in each class
/// is what explains the values in it best (expectation maximisation; Robbins, An empirical Bayes approach to
/// statistics, 1956). So whether voxels have partial volume at all, and how wide vessels are, is learnt from
/// the scan. The scan's noise must be white and its blur less than a voxel's own width; values may be cut off
/// at the scan's lowest and highest.
VoxelShares voxel_shares(const Volume& volume, const Mask& reach, const VoxelScale& scale);

}  // namespace xraycast
