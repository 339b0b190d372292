#include "xraycast/segmentation/segment.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/evidence/vessel_evidence.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/bone.hpp"
#include "xraycast/segmentation/denoise.hpp"
#include "xraycast/segmentation/gap_closing.hpp"
#include "xraycast/segmentation/lumen_completion.hpp"
#include "xraycast/segmentation/trabecular_bone.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace xraycast {
namespace {

constexpr std::int64_t kMinSlices = 10;

void subtract(Mask& mask, const Mask& other) {
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    const auto slice = static_cast<std::size_t>(mask.geometry.slice_voxels()),
               first = static_cast<std::size_t>(z) * slice;
    for (std::size_t i = first; i < first + slice; ++i)
      mask.voxels[i] &= static_cast<std::uint8_t>(other.voxels[i] ^ 1);
  });
}

Mask united(Mask a, const Mask& b) {
  for (std::size_t i = 0; i < a.voxels.size(); ++i) a.voxels[i] |= b.voxels[i];
  return a;
}

void intersect(Mask& mask, const Mask& other) {
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) mask.voxels[i] &= other.voxels[i];
}

/// Removes components that are nowhere thicker than two voxels: partial volume of bone, and noise.
void remove_thin_components(Mask& mask) {
  const Components components(mask);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  for (const Components::Run& run : components.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
      if (keep[static_cast<std::size_t>(run.component)]) break;
      const Index3 voxel = voxel_at(mask.geometry, i);
      if (std::all_of(kNeighbours.begin(), kNeighbours.begin() + 18,
                      [&](const Index3& step) { return mask.at(voxel + step); }))
        keep[static_cast<std::size_t>(run.component)] = true;
    }
  mask = components.select(keep);
}

void check(const Volume& volume, const SegmentOptions& options, const std::string& name) {
  const VolumeGeometry& g = volume.geometry();
  if (g.size.z < kMinSlices)
    throw InputError("{}: {}, too few to follow vessels; at least {} are needed", name,
                     pluralize(g.size.z, "slice"), kMinSlices);
  for (const auto* points : {&options.markers.vessels_mm, &options.markers.not_vessels_mm})
    for (const glm::dvec3& p : *points) {
      const glm::dvec3 lower = g.lower_mm(), upper = g.upper_mm();
      for (int axis = 0; axis < 3; ++axis)
        if (p[axis] < lower[axis] || p[axis] > upper[axis])
          throw InputError(
              "{}: the point ({:.1f}, {:.1f}, {:.1f}) mm lies outside the scan, which extends from ({:.1f}, "
              "{:.1f}, {:.1f}) to ({:.1f}, {:.1f}, {:.1f}) mm",
              name, p.x, p.y, p.z, lower.x, lower.y, lower.z, upper.x, upper.y, upper.z);
    }
}

HuWindow resolve_window(const Volume& volume, const SegmentOptions& options, const std::string& name,
                        Progress& progress) {
  if (!options.window_hu) return window_of(measure_contrast(volume, name, progress));
  const auto [low, high] = *options.window_hu;
  if (low >= high)
    throw InputError("{}: the window's lower limit, {} HU, is not below its upper one, {} HU", name, low,
                     high);
  return {low, low, high};
}

/// Whether there is air around the body; a scan without it was subtracted, so that only vessels are bright.
bool has_air(const Volume& volume) {
  return std::ranges::any_of(volume.hu(), [](std::int16_t hu) { return hu < -500; });
}

/// Vessels of a scan that shows nothing else bright, however thin, by the evidence of lumen in its voxels.
SegmentedVessels segment_by_evidence(const Volume& volume, const Markers& markers, const std::string& name,
                                     ComputeDevice& device, Progress& progress) {
  auto [mask, fill, scale] = find_vessels(volume, measure_noise_hu(volume), device, progress);
  if (mask.count() == 0)
    throw InputError(
        "{}: no vessel: no bright structure stands out from the noise; give a scan with less noise, or the "
        "window of the vessels' CT numbers",
        name);
  if (markers.vessels_mm.empty() && markers.not_vessels_mm.empty()) {
    mask = without_small_components(mask);
  } else {
    separate_chambers(mask, markers, name, progress);
    mask = select_vessels(mask, markers, name, progress);
  }
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] == 0) fill.shares[i] = 0;
  return {std::move(mask), std::move(fill), scale};
}

}  // namespace

Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name, Progress& progress) {
  constexpr std::size_t kTried = 16;
  progress.begin("selecting", kTried, "components");
  const Components components(mask);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  if (!markers.vessels_mm.empty()) {
    for (const glm::dvec3& seed : markers.vessels_mm)
      keep[static_cast<std::size_t>(components.at(nearest_voxel(mask, seed, name)))] = true;
    return components.select(keep);
  }
  // Weighted by the integral of the distance transform. A vessel that branches by Murray's law into n ends
  // has as much as n^(1/3) tubes as wide as its trunk; plates and shells have more than one with 125 ends.
  constexpr double kMinSlenderness = 2, kMaxOfATube = 5, kMinShare = 0.01;
  std::vector<int> order(static_cast<std::size_t>(components.count()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, [&](int a, int b) { return components.voxels(a) > components.voxels(b); });
  order.resize(std::min(order.size(), kTried));
  const glm::dvec3 s = mask.geometry.spacing_mm;
  std::vector<double> weights(static_cast<std::size_t>(components.count()));
  for (const int component : order) {
    progress.advance();
    keep.assign(keep.size(), false);
    keep[static_cast<std::size_t>(component)] = true;
    const Mask alone = components.select(keep);
    const Box box = bounding_box(alone);
    const auto distance_mm = distance_to_background_mm(crop(alone, grown(box, 1, mask.geometry.size)));
    const double radius_mm = *std::ranges::max_element(distance_mm),
                 length_mm = glm::length(s * glm::dvec3(box.upper - box.lower)),
                 volume = static_cast<double>(components.voxels(component)) * s.x * s.y * s.z,
                 tube = std::numbers::pi * radius_mm * radius_mm * length_mm;
    if (length_mm >= 2 * kMinSlenderness * radius_mm && volume <= kMaxOfATube * tube)
      weights[static_cast<std::size_t>(component)] = std::reduce(distance_mm.begin(), distance_mm.end(), 0.0);
  }
  const double best = components.count() > 0 ? *std::ranges::max_element(weights) : 0;
  for (std::size_t i = 0; i < keep.size(); ++i) keep[i] = weights[i] > 0 && weights[i] >= kMinShare * best;
  if (best > 0) return components.select(keep);
  throw InputError(
      "{}: no vessel: no bright structure is longer than it is wide; give a seed, a point in a vessel", name);
}

namespace {

/// The steps for a scan that shows more than vessels, or whose window is given.
Mask segment_by_thresholds(const Volume& volume, const SegmentOptions& options, const std::string& name,
                           ComputeDevice& device, Progress& progress) {
  progress.begin("contrast", 4, "passes");
  std::optional<Volume> quiet = denoised(volume, device);
  progress.advance();
  const Volume& scan = quiet ? *quiet : volume;
  const HuWindow window = resolve_window(scan, options, name, progress);

  progress.begin("thresholding", 1, "scans");
  Mask mask = has_air(scan) ? threshold(scan, window) : threshold_with_hysteresis(scan, window);
  if (2 * mask.count() > volume.geometry().voxel_count())
    throw InputError(
        "{}: no vessel: more than half of the scan lies above {:.0f} HU; give the window of the vessels' CT "
        "numbers",
        name, window.low_hu);
  if (has_air(scan)) intersect(mask, find_body_mask(scan));
  progress.advance();
  if (!has_air(scan) && options.markers.vessels_mm.empty() && options.markers.not_vessels_mm.empty())
    return without_small_components(mask);  // only vessels remain in a subtracted scan

  const Mask bright = mask;
  const Mask bone = has_air(scan) ? find_bone(scan, window, bright, progress) : Mask(mask.geometry);
  subtract(mask, bone);
  separate_chambers(mask, options.markers, name, progress);
  progress.begin("removing trabecular bone", 7, "passes");
  Mask candidates = mask;
  if (has_air(scan)) {
    constexpr double kBeside_mm = 3;
    intersect(candidates, dilated_by_cylinder(bone, kBeside_mm));
    progress.advance();
    const Mask trabecular = find_trabecular_bone(mask, bone, progress);
    subtract(mask, trabecular);
    remove_marrow(mask, united(bone, trabecular));
    progress.advance();
    remove_thin_components(mask);
    progress.advance();
  }
  close_gaps(mask, candidates, progress);
  Mask vessels = select_vessels(mask, options.markers, name, progress);
  progress.begin("filling", 3, "passes");
  add_partial_volume_rim(bright, vessels);
  progress.advance();
  add_dense_wall(scan, window, bone, vessels);
  progress.advance();
  constexpr double kStrut_mm2 = 30;
  fill_holes(vessels, kStrut_mm2);
  progress.advance();
  return vessels;
}

}  // namespace

SegmentedVessels segment_vessels(const Volume& volume, const SegmentOptions& options, const std::string& name,
                                 ComputeDevice& device, Progress& progress) {
  check(volume, options, name);
  if (!options.window_hu && !has_air(volume))
    return segment_by_evidence(volume, options.markers, name, device, progress);
  Mask mask = segment_by_thresholds(volume, options, name, device, progress);
  LumenFill fill = fill_of(volume, mask);
  return {std::move(mask), std::move(fill), {}};
}

Mask segment_mask(const Volume& volume, const SegmentOptions& options, const std::string& name,
                  ComputeDevice& device, Progress& progress) {
  return segment_vessels(volume, options, name, device, progress).mask;
}

}  // namespace xraycast
