#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

/// What to change about a segmentation.
struct SegmentOptions {
  std::optional<std::pair<double, double>>
      window_hu;    ///< lowest and highest HU; otherwise from the histogram
  Markers markers;  ///< seeds, what is no vessel, and the largest radius
};

/// The vessels' mask on the scan's own grid, by the steps in this folder: noise is smoothed where it is
/// heavy, thresholds, bone taken off, chambers parted, marrow taken off, gaps bridged that both have left,
/// and the parts kept that select_vessels chooses. A stage of `progress` for each step.
///
/// Throws InputError, with `name` in front, when there is no vessel, no seed lies in one, or the scan has
/// fewer than 10 slices.
Mask segment_mask(const Volume& volume, const SegmentOptions& options, const std::string& name,
                  ComputeDevice& device, Progress& progress);

/// Keeps the parts of a mask in which seeds lie. Without seeds all parts that are longer than wide, no plate
/// or shell, and in which the distances to the wall add up to a hundredth of the largest part's or more: both
/// sides of a neck whose arteries join below the scan, and not every speck. Chambers are not told here:
/// a wide vessel of which the scan shows a short stretch is as stout as one. A stage of `progress`. Throws
/// InputError, with `name` in front, where there is none.
Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name, Progress& progress);
inline Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name) {
  Progress unheard;
  return select_vessels(mask, markers, name, unheard);
}

}  // namespace xraycast
