#include "xraycast/segmentation/vessel_selection.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/skeleton_graph.hpp"
#include "xraycast/mask/thinning.hpp"
#include "xraycast/skeleton/lumen.hpp"
#include "xraycast/skeleton/skeleton_pruning.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <numbers>
#include <numeric>
#include <vector>

namespace xraycast {
namespace {

/// The volume of tubes around a mask's centrelines, up to the nearest voxels outside.
double volume_of_tubes_mm3(const Mask& mask) {
  const MaskLumen lumen(mask);
  const SkeletonGraph centrelines = prune(trace(thin(mask)), lumen);
  double volume_mm3 = 0;
  for (const SkeletonGraph::Edge& edge : centrelines.edges)
    for (std::size_t i = 1; i < edge.points_mm.size(); ++i) {
      const double radius_mm = lumen.inscribed_radius_mm(edge.points_mm[i]) + 0.5 * lumen.voxel_mm();
      volume_mm3 +=
          std::numbers::pi * radius_mm * radius_mm * glm::distance(edge.points_mm[i - 1], edge.points_mm[i]);
    }
  return volume_mm3;
}

/// The volume of what is at least half as wide as the widest place: an opening by a ball of half its radius.
double volume_of_wide_parts_mm3(const Mask& mask, const std::vector<float>& distance_mm, double radius_mm) {
  Mask core(mask.geometry);
  for (std::size_t i = 0; i < distance_mm.size(); ++i) core.voxels[i] = distance_mm[i] >= 0.5 * radius_mm;
  const std::vector<float> to_core_mm = distance_to_foreground_mm(std::move(core));
  std::int64_t wide = 0;
  for (std::size_t i = 0; i < to_core_mm.size(); ++i)
    wide += mask.voxels[i] != 0 && to_core_mm[i] < 0.5 * radius_mm;
  return static_cast<double>(wide) * voxel_mm3(mask.geometry);
}

/// A component's integral of the distance transform, in mm voxels; 0 for one that is no vessel.
double vessel_weight(const Mask& component) {
  // A vessel that branches by Murray's law into n ends which all are as long as the whole has as much volume
  // as n^(1/3) tubes as wide as its trunk: 2.5 with sixteen. Arteries of the head, the trunk and a dissected
  // aorta have 0.5 to 1.8.
  constexpr double kMinSlenderness = 2, kMaxOfOneTube = 2.5;
  // Malformations of hundreds of ends have 3 and more, as have ventricles full of papillary muscles; plates
  // and shells have more than 4. But a malformation's volume is that of tubes around its centrelines (1.1
  // to 1.3; a ventricle has 1.9), and its wide parts are about one tube (0.9 to 1; a ventricle has 1.4,
  // shells more).
  constexpr double kMaxOfTubes = 1.5, kMaxOfWideParts = 1.2;
  const Box box = bounding_box(component);
  const Mask part = crop(component, grown(box, 1, component.geometry.size));
  const std::vector<float> distance_mm = distance_to_background_mm(part);
  const double radius_mm = *std::ranges::max_element(distance_mm),
               length_mm = glm::length(part.geometry.spacing_mm * glm::dvec3(box.upper - box.lower)),
               volume_mm3 = static_cast<double>(part.count()) * voxel_mm3(part.geometry),
               tube_mm3 = std::numbers::pi * radius_mm * radius_mm * length_mm;
  const auto is_bush = [&] {
    return volume_of_wide_parts_mm3(part, distance_mm, radius_mm) <= kMaxOfWideParts * tube_mm3 &&
           volume_mm3 <= kMaxOfTubes * volume_of_tubes_mm3(part);
  };
  const bool is_vessel =
      length_mm >= 2 * kMinSlenderness * radius_mm && (volume_mm3 <= kMaxOfOneTube * tube_mm3 || is_bush());
  return is_vessel ? std::reduce(distance_mm.begin(), distance_mm.end(), 0.0) : 0;
}

}  // namespace

Mask select_vessels(const Mask& mask, const Markers& markers, const std::string& name, Progress& progress) {
  constexpr std::size_t kTried = 16;
  constexpr double kMinFraction = 0.01;
  progress.begin("selecting", kTried, "components");
  const Components components(mask);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  if (!markers.vessels_mm.empty()) {
    for (const glm::dvec3& seed : markers.vessels_mm)
      keep[static_cast<std::size_t>(components.at(nearest_voxel(mask, seed, name)))] = true;
    return components.select(keep);
  }

  std::vector<int> largest(static_cast<std::size_t>(components.count()));
  std::iota(largest.begin(), largest.end(), 0);
  std::ranges::sort(largest, [&](int a, int b) { return components.voxels(a) > components.voxels(b); });
  largest.resize(std::min(largest.size(), kTried));
  std::vector<double> weights(static_cast<std::size_t>(components.count()));
  for (const int component : largest) {
    progress.advance();
    keep.assign(keep.size(), false);
    keep[static_cast<std::size_t>(component)] = true;
    weights[static_cast<std::size_t>(component)] = vessel_weight(components.select(keep));
  }
  const double best = weights.empty() ? 0 : *std::ranges::max_element(weights);
  if (best == 0)
    throw InputError(
        "{}: no vessel: no bright structure is longer than it is wide; give a seed, a point in a vessel",
        name);
  for (std::size_t i = 0; i < keep.size(); ++i) keep[i] = weights[i] > 0 && weights[i] >= kMinFraction * best;
  return components.select(keep);
}

}  // namespace xraycast
