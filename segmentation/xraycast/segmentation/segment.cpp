#include "xraycast/segmentation/segment.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/segmentation/body.hpp"
#include "xraycast/segmentation/bridges.hpp"
#include "xraycast/segmentation/denoise.hpp"
#include "xraycast/segmentation/exclusion.hpp"
#include "xraycast/segmentation/line_ends.hpp"
#include "xraycast/segmentation/line_vessels.hpp"
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

/// Takes parts off that are nowhere thicker than two voxels: bone that fills its voxels only partly, and
/// noise.
void drop_shells(Mask& mask) {
  const Components parts(mask);
  std::vector<bool> keep(static_cast<std::size_t>(parts.count()));
  for (const Components::Run& run : parts.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
      if (keep[static_cast<std::size_t>(run.component)]) break;
      const Index3 voxel = voxel_at(mask.geometry, i);
      if (std::all_of(kNeighbours.begin(), kNeighbours.begin() + 18,
                      [&](const Index3& step) { return mask.at(voxel + step); }))
        keep[static_cast<std::size_t>(run.component)] = true;
    }
  mask = parts.select(keep);
}

void check(const Volume& volume, const SegmentOptions& options, const std::string& name) {
  const VolumeGeometry& g = volume.geometry();
  if (g.size.z < kMinSlices)
    throw InputError("{}: {}, too few to follow vessels; {} are needed", name, pluralize(g.size.z, "slice"),
                     kMinSlices);
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

HuWindow resolve_window(const Volume& volume, const SegmentOptions& options, const std::string& name,
                        Progress& progress) {
  if (!options.window_hu) return window_of(measure_contrast(volume, name, progress));
  const auto [low, high] = *options.window_hu;
  if (low >= high) throw InputError("window_hu: {} is not below {}", low, high);
  return {low, low, high};
}

/// Whether there is what a body lies in; without, bright neighbours have been subtracted and nothing touches.
bool has_air(const Volume& volume) {
  return std::ranges::any_of(volume.hu(), [](std::int16_t hu) { return hu < -500; });
}

/// Where noise is so heavy that neither bone nor chambers can be told, lines are what is found.
Mask vessels_in_noise(const Volume& volume, const Markers& markers, const std::string& name,
                      ComputeDevice& device, Progress& progress) {
  constexpr double kFollowed_vox = 0.7, kLumen_vox = 0.8;
  progress.begin("looking for lines", 2, "scans");
  Mask lines = find_line_vessels(line_strength(volume, device), volume.geometry());
  progress.advance();
  lines = united(ways_beyond_ends(local_rise(volume, kFollowed_vox, device), lines, progress), lines);
  progress.advance();
  Mask vessels = with_lumen(lines, local_rise(volume, kLumen_vox, device));
  if (vessels.count() == 0) throw InputError("{}: no vessel: no line stands out of the noise", name);
  if (markers.vessels_mm.empty() && markers.not_vessels_mm.empty()) return without_specks(vessels);
  part_from_chambers(vessels, markers, name, progress);
  return select_vessels(vessels, markers, name, progress);
}

}  // namespace

Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name, Progress& progress) {
  constexpr std::size_t kTried = 16;
  progress.begin("selecting", kTried, "parts");
  const Components parts(mask);
  std::vector<bool> keep(static_cast<std::size_t>(parts.count()));
  if (!markers.vessels_mm.empty()) {
    for (const glm::dvec3& seed : markers.vessels_mm)
      keep[static_cast<std::size_t>(parts.at(nearest_voxel(mask, seed, name)))] = true;
    return parts.select(keep);
  }
  // Weighed by how much lies in thick places. A vessel that forks by Murray's law into n ends holds as much
  // as n^(1/3) tubes as wide as its trunk; plates and shells hold more than one of 125 ends.
  constexpr double kMinSlenderness = 2, kMaxOfATube = 5, kMinShare = 0.01;
  std::vector<int> order(static_cast<std::size_t>(parts.count()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, [&](int a, int b) { return parts.voxels(a) > parts.voxels(b); });
  order.resize(std::min(order.size(), kTried));
  const glm::dvec3 s = mask.geometry.spacing_mm;
  std::vector<double> weights(static_cast<std::size_t>(parts.count()));
  for (const int part : order) {
    progress.advance();
    keep.assign(keep.size(), false);
    keep[static_cast<std::size_t>(part)] = true;
    const Mask alone = parts.select(keep);
    const Box box = bounding_box(alone);
    const auto distance_mm = distance_to_outside_mm(crop(alone, grown(box, 1, mask.geometry.size)));
    const double radius_mm = *std::ranges::max_element(distance_mm),
                 length_mm = glm::length(s * glm::dvec3(box.upper - box.lower)),
                 volume = static_cast<double>(parts.voxels(part)) * s.x * s.y * s.z,
                 tube = std::numbers::pi * radius_mm * radius_mm * length_mm;
    if (length_mm >= 2 * kMinSlenderness * radius_mm && volume <= kMaxOfATube * tube)
      weights[static_cast<std::size_t>(part)] = std::reduce(distance_mm.begin(), distance_mm.end(), 0.0);
  }
  const double best = parts.count() > 0 ? *std::ranges::max_element(weights) : 0;
  for (std::size_t part = 0; part < keep.size(); ++part)
    keep[part] = weights[part] > 0 && weights[part] >= kMinShare * best;
  if (best > 0) return parts.select(keep);
  throw InputError("{}: no vessel: nothing bright is longer than it is wide", name);
}

Mask segment_mask(const Volume& volume, const SegmentOptions& options, const std::string& name,
                  ComputeDevice& device, Progress& progress) {
  check(volume, options, name);
  progress.begin("contrast", 5, "passes");
  if (!options.window_hu && is_buried_in_noise(volume))
    return vessels_in_noise(volume, options.markers, name, device, progress);
  progress.advance();
  std::optional<Volume> quiet = denoised(volume, device);
  progress.advance();
  const Volume& scan = quiet ? *quiet : volume;
  const HuWindow window = resolve_window(scan, options, name, progress);

  progress.begin("thresholding", 1, "scans");
  Mask mask = has_air(scan) ? threshold(scan, window) : threshold_with_hysteresis(scan, window);
  if (2 * mask.count() > volume.geometry().voxel_count())
    throw InputError("{}: no vessel: more than half of the scan lies above {:.0f} HU; give another window",
                     name, window.low_hu);
  if (has_air(scan)) intersect(mask, find_body(scan));
  progress.advance();
  if (!has_air(scan) && options.markers.vessels_mm.empty() && options.markers.not_vessels_mm.empty())
    return without_specks(mask);  // nothing but vessels is left in a subtracted scan

  const Mask bright = mask;
  const Mask bone = has_air(scan) ? find_bone(scan, window, bright, progress) : Mask(mask.geometry);
  subtract(mask, bone);
  part_from_chambers(mask, options.markers, name, progress);
  progress.begin("taking off marrow", 7, "passes");
  Mask candidates = mask;
  if (has_air(scan)) {
    constexpr double kBeside_mm = 3;
    intersect(candidates, dilated(bone, kBeside_mm));
    progress.advance();
    const Mask spongy = find_spongy_bone(mask, bone, progress);
    subtract(mask, spongy);
    drop_marrow(mask, united(bone, spongy));
    progress.advance();
    drop_shells(mask);
    progress.advance();
  }
  bridge_gaps(mask, candidates, progress);
  Mask vessels = select_vessels(mask, options.markers, name, progress);
  progress.begin("filling up", 3, "passes");
  add_rim(bright, vessels);
  progress.advance();
  add_dense_wall(scan, window, bone, vessels);
  progress.advance();
  constexpr double kStrut_mm2 = 30;
  fill_holes(vessels, kStrut_mm2);
  progress.advance();
  return vessels;
}

}  // namespace xraycast
