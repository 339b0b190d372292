#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <string>

namespace xraycast {

/// What the histogram of a scan says about its vessels.
struct Contrast {
  double tissue_hu;      ///< what most of the body around vessels has
  double vessel_hu;      ///< what the contrast-filled lumen has
  double noise_hu;       ///< standard deviation
  bool has_bone = true;  ///< false where there is no air either: a subtracted scan, of vessels alone
  double step_hu() const { return vessel_hu - tissue_hu; }
};

/// CT angiographies have a peak of contrast-filled vessels between 200 and 700 HU (guidelines ask for 250 and
/// more in the aorta), apart from the ramp of trabecular bone below and of cortical bone above it. The
/// histogram of scans without air, such as subtracted ones, is split into two classes instead (Ridler and
/// Calvard, Picture thresholding using an iterative selection method, 1978). Throws InputError, with `name`
/// in front, when there is nothing bright. Three units of `progress`.
Contrast measure_contrast(const Volume& volume, const std::string& name, Progress& progress);
inline Contrast measure_contrast(const Volume& volume, const std::string& name) {
  Progress unheard;
  return measure_contrast(volume, name, unheard);
}

/// The standard deviation of the noise, from the median absolute second difference along x of voxels that are
/// neither air nor at an end of the scan's range of values. Of a scan that is cut off, such as at its
/// background's level, only the noise above is seen, which spreads less. How much less tells the share of
/// voxels at the lowest value between neighbours that are not: in padding there is none, in noise that is cut
/// off in the middle every second one.
double measure_noise_hu(const Volume& volume);

}  // namespace xraycast
