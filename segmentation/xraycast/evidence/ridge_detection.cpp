#include "xraycast/evidence/ridge_detection.hpp"

#include "xraycast/evidence/block_filter.hpp"
#include "xraycast/evidence/robust_statistics.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/thinning.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace xraycast {
namespace {

constexpr int kReach_vox = 7;  ///< of a line integral to either side
constexpr double kSurround_vox = 3;
constexpr double kStrong = 4.25;  ///< standard deviations of a ridge that is no noise
constexpr auto kHalo = static_cast<std::int64_t>(3 * kSurround_vox);  ///< the reach of the widest Gaussian

/// Gaussians of `across_vox` and of the surround, subtracted.
cl::Buffer difference_of_gaussians(BlockFilter& block, const cl::Buffer& values, double across_vox) {
  std::vector<float> narrow = block.download(block.smooth(values, glm::dvec3(across_vox)));
  const std::vector<float> wide = block.download(block.smooth(values, glm::dvec3(kSurround_vox)));
  for (std::size_t i = 0; i < narrow.size(); ++i) narrow[i] -= wide[i];
  return block.upload(narrow);
}

Mask above(const std::vector<float>& values, const VolumeGeometry& grid, double threshold) {
  Mask mask(grid);
  std::ranges::transform(values, mask.voxels.begin(),
                         [&](float v) { return static_cast<std::uint8_t>(v > threshold); });
  return mask;
}

/// The components of a mask that hold a voxel of `core`.
Mask components_with(const Mask& mask, const Mask& core) {
  const Components components(mask);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  for (const Components::Run& run : components.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i)
      if (core.voxels[static_cast<std::size_t>(i)] != 0) keep[static_cast<std::size_t>(run.component)] = true;
  return components.select(keep);
}

/// A spur of a skeleton: from its tip, a voxel with one neighbour, up to a bifurcation or the other end.
std::vector<Index3> spur_at(const Mask& skeleton, Index3 here) {
  std::vector<Index3> spur;
  std::vector<Index3> next = neighbours_in(skeleton, here);
  for (Index3 before = here; next.size() <= 2; next = neighbours_in(skeleton, here)) {
    spur.push_back(here);
    const auto onwards = std::ranges::find_if(next, [&](const Index3& n) { return n != before; });
    if (onwards == next.end()) break;
    before = here;
    here = *onwards;
  }
  return spur;
}

/// Prunes the spurs of a skeleton whose mean contrast is below `min_contrast`, and returns them.
Mask prune_dark_spurs(Mask& skeleton, const std::vector<float>& contrast, double min_contrast) {
  Mask pruned(skeleton.geometry);
  while (true) {
    check_cancelled();
    std::vector<Index3> found;  // all of them, before a bifurcation becomes an end
    for (std::size_t i = 0; i < skeleton.voxels.size(); ++i) {
      if (skeleton.voxels[i] == 0) continue;
      const Index3 tip = voxel_at(skeleton.geometry, static_cast<std::int64_t>(i));
      if (neighbours_in(skeleton, tip).size() != 1) continue;
      const std::vector<Index3> spur = spur_at(skeleton, tip);
      double sum = 0;
      for (const Index3& voxel : spur) sum += static_cast<double>(contrast[skeleton.offset(voxel)]);
      if (sum < min_contrast * static_cast<double>(spur.size()))
        found.insert(found.end(), spur.begin(), spur.end());
    }
    if (found.empty()) return pruned;
    for (const Index3& voxel : found) skeleton[voxel] = 0, pruned[voxel] = 1;
  }
}

}  // namespace

Mask large_components(const Mask& mask, std::int64_t min_voxels) {
  const Components components(mask);
  std::vector<bool> keep;
  for (int c = 0; c < components.count(); ++c) keep.push_back(components.voxels(c) >= min_voxels);
  return components.select(keep);
}

Mask with_weak_links(const Mask& strong, const Mask& weak) {
  const Components strong_components(strong), weak_components(weak);
  std::vector<std::int32_t> component_of(strong.voxels.size(), -1);
  for (const Components::Run& run : strong_components.runs())
    std::fill_n(component_of.begin() + run.first, run.length, run.component);
  std::vector<std::int32_t> touched(static_cast<std::size_t>(weak_components.count()), -1);
  std::vector<bool> is_link(touched.size());
  for (const Components::Run& run : weak_components.runs()) {
    const auto weak_component = static_cast<std::size_t>(run.component);
    for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
      const Index3 voxel = voxel_at(strong.geometry, i);
      for (const Index3& step : kNeighbours) {
        if (!strong.at(voxel + step)) continue;
        const std::int32_t component = component_of[strong.offset(voxel + step)];
        std::int32_t& other = touched[weak_component];
        if (other >= 0 && other != component) is_link[weak_component] = true;
        other = component;
      }
    }
  }
  Mask result = weak_components.select(is_link);
  for (std::size_t i = 0; i < result.voxels.size(); ++i)
    if (strong.voxels[i] != 0) result.voxels[i] = 1;
  return result;
}

std::vector<float> ridge_strength(const Volume& volume, ComputeDevice& device) {
  constexpr double kAcross_vox = 0.5, kAlong_vox = 3.5;
  constexpr int kDirections = 64;
  const auto [lowest, highest] = std::ranges::minmax(volume.hu());
  const double least_hu = 0.01 * (highest - lowest);
  return filtered(volume, device, kHalo + kReach_vox, [=](BlockFilter& block, const cl::Buffer& values) {
    return block.ridge_strength(difference_of_gaussians(block, values, kAcross_vox), kAlong_vox, kReach_vox,
                                kDirections, least_hu);
  });
}

std::vector<float> contrast_to_noise(const Volume& volume, double across_vox, ComputeDevice& device,
                                     double least_unit_hu) {
  std::vector<float> contrast =
      filtered(volume, device, kHalo, [&](BlockFilter& block, const cl::Buffer& values) {
        return difference_of_gaussians(block, values, across_vox);
      });
  const RobustStatistics noise = statistics_of(contrast);
  const double unit = std::max(noise.standard_deviation, least_unit_hu);
  for (float& v : contrast)
    v = unit > 0 ? static_cast<float>((static_cast<double>(v) - noise.median) / unit) : 0;  // mostly padding
  return contrast;
}

double strong_ridge(const std::vector<float>& strength) {
  return statistics_of_nonzero(strength).above(kStrong);
}

Mask detect_ridges(const std::vector<float>& strength, const VolumeGeometry& grid, double least) {
  constexpr double kWeak = 3, kWeakOfLeast = 0.7;
  constexpr std::int64_t kMinVoxels = 5, kCertainVoxels = 2 * kReach_vox;
  const RobustStatistics noise = statistics_of_nonzero(strength);
  const double strong_limit = std::max(noise.above(kStrong), least),
               weak_limit = std::max(noise.above(kWeak), kWeakOfLeast * least);
  const Mask strong = large_components(above(strength, grid, strong_limit), kMinVoxels);
  Mask weak = above(strength, grid, weak_limit);
  for (std::size_t i = 0; i < weak.voxels.size(); ++i)
    if (strong.voxels[i] != 0) weak.voxels[i] = 0;
  return components_with(with_weak_links(strong, weak), large_components(strong, kCertainVoxels));
}

PrunedSkeleton pruned_skeleton(const Mask& vessels, const std::vector<float>& contrast) {
  constexpr double kMinOfASpur = 2.5;
  Mask kept = thin(vessels);
  Mask pruned = prune_dark_spurs(kept, contrast, kMinOfASpur);
  return {std::move(kept), std::move(pruned)};
}

}  // namespace xraycast
