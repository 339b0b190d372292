#include "xraycast/segment.hpp"

#include "xraycast/components.hpp"
#include "xraycast/distance_transform.hpp"
#include "xraycast/error.hpp"
#include "xraycast/exclusion.hpp"
#include "xraycast/line_filter.hpp"
#include "xraycast/parallel.hpp"
#include "xraycast/vesselness.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace xraycast {
namespace {

constexpr std::int64_t kLeastSlices = 10;

double voxel_mm3(const VolumeGeometry& g) { return g.spacing_mm.x * g.spacing_mm.y * g.spacing_mm.z; }

void subtract(Mask& mask, const Mask& other) {
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    const auto slice = static_cast<std::size_t>(mask.geometry.slice_voxels()),
               first = static_cast<std::size_t>(z) * slice;
    for (std::size_t i = first; i < first + slice; ++i)
      mask.voxels[i] &= static_cast<std::uint8_t>(other.voxels[i] ^ 1);
  });
}

void check(const Volume& volume, const SegmentOptions& options, const std::string& name) {
  const VolumeGeometry& g = volume.geometry();
  if (g.size.z < kLeastSlices)
    throw InputError("{}: {} slices are too few to follow vessels; {} are needed", name, g.size.z,
                     kLeastSlices);
  for (const auto* points : {&options.markers.vessels_mm, &options.markers.not_vessels_mm})
    for (const glm::dvec3& p : *points) {
      const glm::dvec3 lower = g.lower_mm(), upper = g.upper_mm();
      for (int axis = 0; axis < 3; ++axis)
        if (p[axis] < lower[axis] || p[axis] > upper[axis])
          throw InputError(
              "{}: the point ({:.1f}, {:.1f}, {:.1f}) mm lies outside the scan, which reaches from ({:.1f}, "
              "{:.1f}, {:.1f}) to ({:.1f}, {:.1f}, {:.1f}) mm",
              name, p.x, p.y, p.z, lower.x, lower.y, lower.z, upper.x, upper.y, upper.z);
    }
}

HuWindow resolve_window(const Volume& volume, const SegmentOptions& options, const std::string& name) {
  if (!options.window_hu) return window_of(measure_contrast(volume, name));
  const auto [low, high] = *options.window_hu;
  if (low >= high) throw InputError("--window: {} is not below {}", low, high);
  return {low, low, high};
}

}  // namespace

Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name) {
  const Components parts(mask);
  std::vector<bool> keep(static_cast<std::size_t>(parts.count()));
  if (!markers.vessels_mm.empty()) {
    for (const glm::dvec3& seed : markers.vessels_mm)
      keep[static_cast<std::size_t>(parts.at(nearest_voxel(mask, seed, name)))] = true;
    return parts.select(keep);
  }
  // Longer than wide: more than three spheres of its largest radius fit in. The largest parts are tried
  // first.
  std::vector<int> order(static_cast<std::size_t>(parts.count()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, [&](int a, int b) { return parts.voxels(a) > parts.voxels(b); });
  constexpr std::size_t kTried = 5;
  for (std::size_t i = 0; i < std::min(kTried, order.size()); ++i) {
    keep.assign(keep.size(), false);
    keep[static_cast<std::size_t>(order[i])] = true;
    const Mask part = parts.select(keep);
    const Mask cropped = crop(part, grown(bounding_box(part), 1, mask.geometry.size));
    const auto distance_mm = distance_to_outside_mm(cropped);
    const double radius_mm = *std::ranges::max_element(distance_mm),
                 sphere_mm3 = 4 / 3.0 * std::numbers::pi * std::pow(radius_mm, 3);
    if (static_cast<double>(parts.voxels(order[i])) * voxel_mm3(mask.geometry) > 3 * sphere_mm3) return part;
  }
  throw InputError("{}: no vessel: nothing bright is longer than it is wide", name);
}

Mask segment_mask(const Volume& volume, const SegmentOptions& options, const std::string& name,
                  Device& device, Progress& progress) {
  check(volume, options, name);
  progress.begin("contrast", 1, "scans");
  std::optional<Volume> quiet = denoised(volume, device);
  const Volume& scan = quiet ? *quiet : volume;
  const HuWindow window = resolve_window(scan, options, name);
  progress.advance();

  progress.begin("thresholding", 1, "scans");
  Mask mask = threshold(scan, window);
  progress.advance();
  progress.begin("taking off bone", 1, "scans");
  subtract(mask, find_bone(scan, window, mask));
  progress.advance();
  progress.begin("vesselness", 1, "scans");
  add_thin_vessels(scan, window, mask, device, progress);
  progress.advance();
  constexpr double kStrut_mm2 = 30;
  fill_holes(mask, kStrut_mm2);
  progress.begin("parting chambers", 1, "scans");
  part_from_chambers(mask, options.markers, name);
  progress.advance();
  progress.begin("connecting", 1, "scans");
  Mask vessels = select_vessels(mask, options.markers, name);
  progress.advance();
  return vessels;
}

}  // namespace xraycast
