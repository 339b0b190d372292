#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <optional>
#include <string>

namespace xraycast {

/// The CT numbers of vessels and tissue, from the histogram of a scan.
struct Contrast {
  double tissue_hu;      ///< CT number of most of the body around vessels
  double vessel_hu;      ///< CT number of the contrast-filled lumen
  double noise_hu;       ///< standard deviation
  bool has_bone = true;  ///< false where there is no air either: a subtracted scan, of vessels alone
  double step_hu() const { return vessel_hu - tissue_hu; }
};

/// CT angiographies have a peak of contrast-filled vessels between 200 and 700 HU (guidelines ask for 250 and
/// more in the aorta), distinct from trabecular bone below and cortical bone above. The histogram of scans
/// without air, such as subtracted ones, is split into two classes instead (Ridler and Calvard, Picture
/// thresholding using an iterative selection method, 1978). Nothing where no contrast agent shows. Throws
/// InputError, with `name` in front, when all voxels are alike. Three units of `progress`.
std::optional<Contrast> find_contrast(const Volume& volume, const std::string& name, Progress& progress);

/// The same; throws InputError where no contrast agent shows.
Contrast measure_contrast(const Volume& volume, const std::string& name, Progress& progress);
inline Contrast measure_contrast(const Volume& volume, const std::string& name) {
  Progress unheard;
  return measure_contrast(volume, name, unheard);
}

/// The standard deviation of the noise, from the median absolute second difference along x of voxels that are
/// neither air nor at an end of the scan's range of values. In a scan whose values are clipped, such as at
/// its background's level, only the noise above that is visible, and spreads less. The correction follows
/// from the fraction of voxels at the lowest value between neighbours above it: zero in padding, one half in
/// noise that is clipped at its mean.
double measure_noise_hu(const Volume& volume);

}  // namespace xraycast
