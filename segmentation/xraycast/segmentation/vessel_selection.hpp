#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <string>

namespace xraycast {

/// Keeps the connected components of a mask in which seeds lie. Without seeds all that are elongated, consist
/// of tubes, not of plates, shells or trabeculae, and whose distance transform sums to at least a hundredth
/// of the largest one's: both sides of a neck whose arteries join below the scan, but not every small
/// component. Heart chambers are not recognised here: a short stretch of a wide vessel has the same shape. A
/// stage of `progress`. Throws InputError, with `name` in front, where there is none.
Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name, Progress& progress);
inline Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name) {
  Progress unheard;
  return select_vessels(mask, markers, name, unheard);
}

}  // namespace xraycast
