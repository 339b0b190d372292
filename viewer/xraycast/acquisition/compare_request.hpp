#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/opencl/resident_scan.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/requests/comparison.hpp"
#include "xraycast/sampling/column_samples.hpp"

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// C-arm angles, evenly spaced around the body. Throws InputError unless `views` is 1 to 3600.
std::vector<double> angles_around_deg(int views);

struct ComparedMap {
  std::shared_ptr<const BodyMap> map;
  std::string name;  ///< in front of messages
};

/// Frames of body maps against true projections (DRRs) of the scan from which they were cast. Messages name
/// the fields in backquotes, for with_names().
struct CompareRequest {
  std::vector<ComparedMap> maps{};
  std::vector<double> angles_deg = angles_around_deg(12);
  double cranial_deg = 0;      ///< tilt of the detector in all views
  std::optional<Cone> cone{};  ///< none: a parallel beam
  SampleOptions sampling{};

  /// The instant of maps that move, by their modes; those that are not named are at 0.
  std::map<std::string, double> phase{};
};

/// Throws InputError for what can be compared with no scan.
void check(const CompareRequest& request);

/// The same, and for maps that were not cast from a scan or at another instant; `scan_name` is in front of
/// messages.
void check(const CompareRequest& request, const VolumeGeometry& scan, const std::string& scan_name);

/// A frame's similarity to the DRR of the part of the scan that the map covers, over the pixels whose rays
/// meet it, and its PSNR against the DRR of the whole scan.
struct FrameSimilarity {
  ImageSimilarity covered;
  double whole_psnr_db;
};

/// A map's frames. Errors of optical depth are relative to the largest depth in any view: those relative to
/// each view's own would weigh thin views more.
struct MapComparison {
  std::vector<FrameSimilarity> views;  ///< at each angle
  FrameSimilarity mean;                ///< of these
};

/// One frame and its DRR, H x W optical depths, row 0 on top. Valid during the call.
struct ComparedFrame {
  std::size_t map;  ///< its number in the request
  double angle_deg;
  const View& view;
  std::span<const float> tau, drr_tau;
  const ImageSimilarity& similarity;  ///< error relative to this view's largest depth
};
using CompareListener = std::function<void(const ComparedFrame& frame)>;

/// The comparison of each map, with a stage "comparing"; `listener` is told of every frame, all maps' of an
/// angle before the next angle's. Maps of one opacity and extent share their DRRs. Needs a current OpenGL
/// context. Throws InputError for views that cannot be drawn, DeviceError when a device fails.
std::vector<MapComparison> compare(const CompareRequest& request, const ResidentScan& scan,
                                   Progress& progress, const CompareListener& listener = {});

}  // namespace xraycast
