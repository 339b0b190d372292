#include "xraycast/acquisition/compare_request.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/requests/rays_within.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/same_scan.hpp"

#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>

namespace xraycast {
namespace {

/// The DRR of the part of the scan that a map covers, and the pixels whose rays meet its circle.
struct Drr {
  std::vector<float> tau;
  std::vector<std::uint8_t> counts;
  std::vector<float> whole_tau;  ///< of the whole scan
};

Drr drr_of(const ResidentScan& scan, const View& view, const BodyMap& map, Progress& progress) {
  const auto rays = rays_within(view, map.geometry);
  Drr drr{std::vector<float>(rays.size()), {}, project(scan, view, map.opacity(), progress).tau};
  for (const auto& ray : rays) drr.counts.push_back(ray ? 1 : 0);
  const std::vector<PixelSegment> parts = segments_within(view, map.geometry);
  std::vector<RaySegment> segments;
  for (const PixelSegment& part : parts) segments.push_back(part.segment);
  const std::vector<float> depths = project(scan, segments, map.opacity(), progress);
  for (std::size_t i = 0; i < parts.size(); ++i) drr.tau[parts[i].pixel] += depths[i];
  return drr;
}

/// The DRRs of the view at hand, which maps of the same opacity and extent share.
class DrrsOfView {
 public:
  DrrsOfView(const ResidentScan& scan, Progress& progress) : scan_(scan), progress_(progress) {}

  const Drr& of(const View& view, const BodyMap& map) {
    const MapGeometry extent = extent_of(map.geometry);
    if (!known_.empty() && known_.front().view != view) known_.clear();
    const auto found = std::ranges::find_if(
        known_, [&](const Known& known) { return known.opacity == map.opacity() && known.extent == extent; });
    if (found != known_.end()) return found->drr;
    known_.push_back({view, map.opacity(), extent, drr_of(scan_, view, map, progress_)});
    return known_.back().drr;
  }

 private:
  struct Known {
    View view;
    Opacity opacity;
    MapGeometry extent;
    Drr drr;
  };

  /// What of a map its DRR depends on: not how many shells there are, nor their samples.
  static MapGeometry extent_of(MapGeometry geometry) {
    geometry.radii_mm = {geometry.radii_mm.front(), geometry.radii_mm.back()};
    geometry.step_mm = 1;
    return geometry;
  }

  const ResidentScan& scan_;
  Progress& progress_;
  std::deque<Known> known_;
};

View compared_view(const CompareRequest& request, double angle_deg, const BodyBounds& bounds) {
  return fitted({.lao_rad = glm::radians(angle_deg),
                 .cranial_rad = glm::radians(request.cranial_deg),
                 .cone = request.cone,
                 .centre_mm = bounds.centre_mm},
                bounds);
}

void take_largest_of_all(std::vector<FrameSimilarity>& views) {
  double deepest = 0;
  for (const FrameSimilarity& one : views) deepest = std::max(deepest, one.covered.deepest);
  for (FrameSimilarity& one : views)
    if (deepest > 0) one.covered.rmse *= one.covered.deepest / deepest;
}

FrameSimilarity mean_of(const std::vector<FrameSimilarity>& views) {
  FrameSimilarity mean{};
  const auto count = static_cast<double>(views.size());
  for (const auto& [covered, whole_psnr_db] : views) {
    mean.covered.psnr_db += covered.psnr_db / count;
    mean.covered.ssim += covered.ssim / count;
    mean.covered.rmse += covered.rmse / count;
    mean.whole_psnr_db += whole_psnr_db / count;
  }
  return mean;
}

}  // namespace

std::vector<double> angles_around_deg(int views) {
  if (views < 1 || views > 3600) throw InputError("`views` {}: must be 1 to 3600", views);
  std::vector<double> angles_deg;
  for (int i = 0; i < views; ++i) angles_deg.push_back(360.0 * i / views);
  return angles_deg;
}

void check(const CompareRequest& request) {
  if (request.maps.empty()) throw InputError("`maps`: there are none; give one or more");
  if (request.angles_deg.empty() ||
      !std::ranges::all_of(request.angles_deg, [](double angle) { return std::isfinite(angle); }))
    throw InputError("`angles`: must be one angle or more, in degrees");
  for (const auto& [map, name] : request.maps)
    if (map->spectrum())
      throw InputError("{}: a spectrum map; only maps that hold optical depths can be compared", name);
}

void check(const CompareRequest& request, const VolumeGeometry& scan, const std::string& scan_name) {
  check(request);
  for (const auto& [map, name] : request.maps) {
    check_same_scan(map->geometry, name, scan, scan_name);
    check_same_instant(*map, name, scan_name);
    if (map->keys) map->keys->phases().rhythm().phases_of(request.phase);
  }
}

std::vector<MapComparison> compare(const CompareRequest& request, const ResidentScan& scan,
                                   Progress& progress, const CompareListener& listener) {
  std::vector<MapComparison> comparisons(request.maps.size());
  std::vector<Renderer> renderers(request.maps.size());
  for (std::size_t i = 0; i < renderers.size(); ++i) {
    const auto& map = request.maps[i].map;
    renderers[i].set_map(map);
    if (map->keys) renderers[i].set_phases(map->keys->phases().rhythm().phases_of(request.phase));
  }
  // The stages of each projection are not told, only ended with the whole.
  Progress of_each([&](const Progress::State&) { progress.check(); });
  DrrsOfView drrs(scan, of_each);
  progress.begin("comparing", std::ssize(request.angles_deg) * std::ssize(request.maps), "frames");
  for (const double angle_deg : request.angles_deg)
    for (std::size_t i = 0; i < renderers.size(); ++i) {
      const BodyMap& map = *request.maps[i].map;
      const View view = compared_view(request, angle_deg, bounds_of(map.geometry));
      const std::vector<float> tau = renderers[i].tau(view, {.sampling = request.sampling});
      const Drr& drr = drrs.of(view, map);
      const auto similarity_to = [&](const std::vector<float>& drr_tau) {
        return compare(tau, drr_tau, drr.counts, view.width, view.height);
      };
      const FrameSimilarity similarity{similarity_to(drr.tau), similarity_to(drr.whole_tau).psnr_db};
      if (listener) listener({i, angle_deg, view, tau, drr.tau, similarity.covered});
      comparisons[i].views.push_back(similarity);
      progress.advance();
    }
  for (MapComparison& comparison : comparisons) {
    take_largest_of_all(comparison.views);
    comparison.mean = mean_of(comparison.views);
  }
  return comparisons;
}

}  // namespace xraycast
