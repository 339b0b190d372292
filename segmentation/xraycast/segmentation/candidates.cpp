#include "xraycast/segmentation/candidates.hpp"

#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/block_filter.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/bone.hpp"
#include "xraycast/segmentation/threshold.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr double kWidth_mm = 2.5, kWidest_vox = 4;

std::vector<float> local_means(const Volume& volume, ComputeDevice& device) {
  const glm::dvec3 sigma_vox = glm::min(kWidth_mm / volume.geometry().spacing_mm, glm::dvec3(kWidest_vox));
  return filtered(
      volume, device, static_cast<std::int64_t>(std::ceil(3 * sigma_vox.z)),
      [&](BlockFilter& block, const cl::Buffer& values) { return block.smooth(values, sigma_vox); });
}

/// Where no vessel is looked for: bone with its marrow and what lies beside it, and all beyond the body.
Mask excluded(const Volume& volume) {
  constexpr double kDense_hu = 300, kBeside_mm = 3;
  Progress unheard;
  const HuWindow window{kDense_hu, kDense_hu, kDense_hu};
  Mask result = dilated_by_cylinder(find_bone(volume, window, Mask(volume.geometry()), unheard), kBeside_mm);
  const Mask body = find_body_mask(volume);
  for (std::size_t i = 0; i < result.voxels.size(); ++i)
    result.voxels[i] |= static_cast<std::uint8_t>(body.voxels[i] ^ 1);
  return result;
}

}  // namespace

std::vector<Candidate> brightest_candidates(const Volume& volume, ComputeDevice& device) {
  constexpr float kBrighterThanTissue_hu = 90, kDarkerThanBone_hu = 300;
  constexpr double kApart_mm = 40;
  constexpr std::size_t kMost = 4;
  const std::vector<float> means = local_means(volume, device);
  const Mask skipped = excluded(volume);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < means.size(); ++i)
    if (skipped.voxels[i] == 0 && means[i] > kBrighterThanTissue_hu && means[i] < kDarkerThanBone_hu)
      order.push_back(i);
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return means[a] > means[b]; });
  std::vector<Candidate> found;
  for (const std::size_t i : order) {
    if (found.size() == kMost) break;
    const Index3 v = voxel_at(volume.geometry(), static_cast<std::int64_t>(i));
    const glm::dvec3 p = volume.geometry().to_world_mm(glm::dvec3(v));
    if (std::ranges::all_of(found,
                            [&](const Candidate& c) { return glm::distance(c.point_mm, p) >= kApart_mm; }))
      found.push_back({p, static_cast<double>(means[i])});
  }
  return found;
}

}  // namespace xraycast
