#include "xraycast/segmentation/candidates.hpp"

#include "xraycast/evidence/block_filter.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/bone.hpp"
#include "xraycast/segmentation/seeds.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace xraycast {
namespace {

constexpr float kBrighterThanTissue_hu = 90, kDarkerThanBone_hu = 300;

std::vector<float> local_means(const Volume& volume, ComputeDevice& device) {
  constexpr double kWidth_mm = 2.5, kWidest_vox = 4;
  const glm::dvec3 sigma_vox = glm::min(kWidth_mm / volume.geometry().spacing_mm, glm::dvec3(kWidest_vox));
  return smoothed(volume, sigma_vox, device);
}

/// The body without bone, its marrow and what lies beside it.
Mask where_candidates_may_lie(const Volume& volume, const Mask& body) {
  constexpr double kDense_hu = 300, kBeside_mm = 3;
  Progress unheard;
  const HuWindow window{kDense_hu, kDense_hu, kDense_hu};
  const Mask bone =
      dilated_by_cylinder(find_bone(volume, window, Mask(volume.geometry()), unheard), kBeside_mm);
  Mask candidates = body;
  subtract(candidates, bone);
  return candidates;
}

/// The voxels that may be candidates, the brightest first.
std::vector<std::size_t> brightest_first(const std::vector<float>& means, const Mask& within) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < means.size(); ++i)
    if (within.voxels[i] != 0 && means[i] > kBrighterThanTissue_hu && means[i] < kDarkerThanBone_hu)
      order.push_back(i);
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return means[a] > means[b]; });
  return order;
}

/// Whether a lumen is as slender as a vessel: five times as long as it is wide, where a kidney is four times.
bool is_slender(const Mask& lumen) {
  constexpr double kSlender = 5;
  const VolumeGeometry& g = lumen.geometry;
  const Box box = bounding_box(lumen);
  if (box.empty()) return false;
  const std::vector<float> depth_mm = distance_to_background_mm(crop(lumen, grown(box, 1, g.size)));
  return glm::length(g.spacing_mm * glm::dvec3(box.upper - box.lower)) >=
         2 * kSlender * static_cast<double>(*std::ranges::max_element(depth_mm));
}

}  // namespace

std::vector<Candidate> brightest_candidates(const Volume& volume, ComputeDevice& device) {
  constexpr double kApart_mm = 30;
  constexpr std::size_t kMost = 3, kTried = 10;
  const std::optional<Volume> smooth = smoothed_for_seeds(volume, device);
  const Volume& scan = smooth ? *smooth : volume;
  const Mask body = find_body_mask(scan);
  const std::vector<float> means = local_means(volume, device);
  std::vector<Candidate> slender, others;
  std::vector<glm::dvec3> tried;
  Mask known(volume.geometry());
  for (const std::size_t i : brightest_first(means, where_candidates_may_lie(volume, body))) {
    if (slender.size() == kMost || tried.size() == kTried) break;
    const glm::dvec3 p =
        volume.geometry().to_world_mm(glm::dvec3(voxel_at(volume.geometry(), static_cast<std::int64_t>(i))));
    if (known.voxels[i] != 0 ||
        std::ranges::any_of(tried, [&](const glm::dvec3& q) { return glm::distance(p, q) < kApart_mm; }))
      continue;
    tried.push_back(p);
    try {
      Markers markers;
      markers.vessels_mm = {p};
      const std::vector<Seed> seeds = look_at_seeds(scan, markers);
      if (seeds.front().hu >= kDarkerThanBone_hu) continue;
      const Mask lumen = lumen_at_seeds(scan, seeds, window_of_seeds(seeds, ""), body, markers, "");
      unite(known, lumen);
      (is_slender(lumen) ? slender : others).push_back({p, seeds.front().hu});
    } catch (const InputError&) {  // in bone, or in an organ
    }
  }
  if (!slender.empty()) return slender;
  others.resize(std::min(others.size(), kMost));
  return others;
}

}  // namespace xraycast
