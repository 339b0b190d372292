#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/evidence/lumen_scale.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

/// No vessels filled with contrast agent stand out; the message names places that may lie in vessels, if any.
class NoContrast : public InputError {
  using InputError::InputError;
};

/// Options of a segmentation.
struct SegmentOptions {
  std::optional<std::pair<double, double>>
      window_hu;    ///< lowest and highest HU; otherwise from the histogram
  Markers markers;  ///< seeds, excluded structures, and the largest radius
};

/// The assumptions of a segmentation and the mask after each of its steps.
struct SegmentLog {
  std::optional<HuWindow> window;   ///< none where vessels were found by evidence
  std::optional<LumenScale> scale;  ///< what was measured on the vessels, where they were found by evidence
  bool is_window_of_seeds = false;  ///< from the seeds' neighbourhoods, not from the histogram
  double noise_hu = 0;              ///< standard deviation
  /// Called after each step with its name and the mask that it leaves.
  std::function<void(const std::string& step, const Mask& mask)> on_step = [](const auto&, const auto&) {};
};

/// Vessels on a scan's own grid.
struct SegmentedVessels {
  Mask mask;
  LumenFill fill;  ///< how full of lumen voxels are
};

/// Vessels of which only the mask is known.
SegmentedVessels with_fill(const Volume& volume, Mask mask);

/// Segments vessels by the steps in this folder: denoising where noise is heavy, thresholds, removal of bone,
/// separation of chambers, removal of trabecular bone, closing of the gaps that both have left, and the
/// selection of components by select_vessels. A scan without air, of vessels alone, is segmented by
/// find_vessels instead, unless a window is given. A stage of `progress` for each step.
///
/// Without a window, seeds outside that of the histogram set it from their own neighbourhoods. What is
/// connected to a seed by lumen of its own brightness, narrower than the largest radius, is kept by all
/// steps.
///
/// Throws LostSeed, with `name` in front, for a seed that lies in no vessel, NoContrast without seeds in a
/// scan without contrast agent, and InputError when there is no vessel, or the scan has fewer than 10 slices.
SegmentedVessels segment_vessels(const Volume& volume, const SegmentOptions& options, const std::string& name,
                                 ComputeDevice& device, Progress& progress, SegmentLog* log = nullptr);

}  // namespace xraycast
