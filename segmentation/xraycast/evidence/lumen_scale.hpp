#pragma once

#include <cstddef>
#include <vector>

namespace xraycast {

class ScanResponse;

/// The lumen's contrast and the scan's own blur, by which brightness tells how full of lumen a voxel is.
struct LumenScale {
  double lumen_hu;  ///< contrast of a voxel full of lumen
  double noise_hu;  ///< standard deviation
  double blur_vox;  ///< standard deviation of the scan's point spread, beside the voxels' own width
  double noise() const { return noise_hu / lumen_hu; }
};

/// A place in the middle of a vessel: its contrast when smoothed by Gaussians of half a voxel and of one, and
/// its ridge strength.
struct MiddleOfVessel {
  double narrow_hu, wide_hu, strength;
};

inline constexpr double kNarrow_vox = 0.5, kWide_vox = 1;

/// Measures both on vessels as a partial-volume model has them: in the middle of a vessel of radius r, a
/// point spread of variance v leaves 1 - exp(-r^2 / 2v) of the lumen's contrast. Two Gaussians more make two
/// equations. In thin vessels their quotient tells the blur, in the widest ones the radius and with it the
/// lumen's contrast; a few passes from the brightest middles settle both. `least_strength` is that of a ridge
/// in noise. Without any middle the lumen's contrast is that of the scan's brightest voxel.
LumenScale measure_lumen_scale(const std::vector<MiddleOfVessel>& middles, const ScanResponse& response,
                               double least_strength);

/// The least ridge strength of a vessel, as a fraction of the lumen's contrast: that of a vessel of half a
/// voxel under a blur of one. Weaker ridges lie between vessels.
inline constexpr double kLeastRidge = 0.03;

}  // namespace xraycast
