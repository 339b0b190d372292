#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/evidence/lumen_scale.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/segmentation/great_vessels.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace xraycast {

/// A vessel mask that is there already: none, a file on the scan's grid in which vessels are above zero, or a
/// mask on that grid.
using GivenMask = std::variant<std::monostate, std::filesystem::path, std::shared_ptr<const Mask>>;

enum class SurfaceKind {
  isosurface,  ///< of the smoothed mask
  tubes,       ///< swept along the centrelines
};

/// By its name; "level-set" is the former one of the isosurface. Throws InputError.
SurfaceKind surface_kind(const std::string& name);

/// What is to be found in a CT angiography. Messages call the two lists of points `seeds` and `not_vessels`.
struct SegmentRequest {
  std::optional<std::pair<double, double>>
      window_hu;    ///< lowest and highest CT number of vessels; otherwise from the histogram
  Markers markers;  ///< seeds, excluded structures, and the largest radius
  GivenMask from_mask;
  std::optional<glm::dvec3> root_mm;  ///< the tree begins at the vessel end nearest to it, else at the widest
  SurfaceKind surface = SurfaceKind::isosurface;
  std::size_t triangles = 50'000;  ///< of the surface, approximately
  /// Called after each step with its name and the mask that it leaves.
  std::function<void(const std::string& step, const Mask& mask)> explain;

  bool has_mask() const { return from_mask.index() != 0; }

  /// Whether no person has pointed at vessels.
  bool is_automatic() const {
    return !has_mask() && markers.vessels_mm.empty() && markers.not_vessels_mm.empty();
  }
};

/// Throws InputError for a request that no scan can fulfil.
void check(const SegmentRequest& request);

/// The assumptions of a segmentation.
struct SegmentLog {
  std::optional<HuWindow> window;   ///< none where vessels were found by evidence
  std::optional<LumenScale> scale;  ///< what was measured on the vessels, where they were found by evidence
  bool is_window_of_seeds = false;  ///< from the seeds' neighbourhoods, not from the histogram
  double noise_hu = 0;              ///< standard deviation
  /// The vessel that was found by place and shape, where no seed was given and it is darker than what the
  /// histogram shows.
  std::optional<GreatVessel> own_seed;
};

/// Vessels on a scan's own grid.
struct SegmentedVessels {
  Mask mask;
  LumenFill fill;  ///< how full of lumen voxels are
};

/// Segments vessels by the steps in this folder: denoising where noise is heavy, thresholds, removal of bone
/// and of vessels to exclude, separation of chambers, removal of trabecular bone, closing of the gaps that
/// both have left, and the selection of components by select_vessels. A scan without air, of vessels alone,
/// is segmented by vessel_evidence instead, unless a window is given. A stage of `progress` for each step.
/// Takes the window, the markers and `explain` of a request.
///
/// Without a window and seeds, the aorta or another great vessel (find_great_vessels) that is darker than the
/// window of the histogram is the seed. Without a window, seeds outside that of the histogram set it from
/// their own neighbourhoods. What is
/// connected to a seed by lumen of its own brightness, narrower than the largest radius, is kept by all
/// steps.
///
/// Throws InputError, with `name` in front, for a seed that lies in no vessel, without seeds in a scan
/// without contrast agent, when there is no vessel, and when the scan has fewer than 10 slices.
SegmentedVessels segment_vessels(const Volume& volume, const SegmentRequest& request, const std::string& name,
                                 ComputeDevice& device, Progress& progress, SegmentLog* log = nullptr);

}  // namespace xraycast
