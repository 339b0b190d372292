#include "xraycast/segmentation/line_vessels.hpp"

#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/thinning.hpp"
#include "xraycast/segmentation/block_filter.hpp"
#include "xraycast/segmentation/contrast.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace xraycast {
namespace {

constexpr int kReach_vox = 7;  ///< of a line to either side
constexpr double kAround_vox = 3;
constexpr auto kHalo = static_cast<std::int64_t>(3 * kAround_vox);  ///< that smoothing reaches to

/// What is bright within `across_vox` voxels, less what is for three around.
cl::Buffer contrast_of(BlockFilter& block, const cl::Buffer& values, double across_vox) {
  std::vector<float> narrow = block.download(block.smooth(values, glm::dvec3(across_vox)));
  const std::vector<float> wide = block.download(block.smooth(values, glm::dvec3(kAround_vox)));
  for (std::size_t i = 0; i < narrow.size(); ++i) narrow[i] -= wide[i];
  return block.upload(narrow);
}

Mask above(const std::vector<float>& values, const VolumeGeometry& grid, double least) {
  Mask mask(grid);
  std::ranges::transform(values, mask.voxels.begin(),
                         [&](float v) { return static_cast<std::uint8_t>(v > least); });
  return mask;
}

/// The parts of at least so many voxels.
Mask large_parts(const Mask& mask, std::int64_t least_voxels) {
  const Components parts(mask);
  std::vector<bool> keep;
  for (int c = 0; c < parts.count(); ++c) keep.push_back(parts.voxels(c) >= least_voxels);
  return parts.select(keep);
}

/// With the parts of `weak` that touch two parts of a mask or more.
Mask with_bridges(const Mask& strong, const Mask& weak) {
  const Components parts(strong), stretches(weak);
  std::vector<std::int32_t> part_of(strong.voxels.size(), -1);
  for (const Components::Run& run : parts.runs())
    std::fill_n(part_of.begin() + run.first, run.length, run.component);
  std::vector<std::int32_t> touched(static_cast<std::size_t>(stretches.count()), -1);
  std::vector<bool> is_bridge(touched.size());
  for (const Components::Run& run : stretches.runs()) {
    const auto stretch = static_cast<std::size_t>(run.component);
    for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
      const Index3 voxel = voxel_at(strong.geometry, i);
      for (const Index3& step : kNeighbours) {
        if (!strong.at(voxel + step)) continue;
        const std::int32_t part = part_of[strong.offset(voxel + step)];
        if (touched[stretch] >= 0 && touched[stretch] != part) is_bridge[stretch] = true;
        touched[stretch] = part;
      }
    }
  }
  Mask result = stretches.select(is_bridge);
  for (std::size_t i = 0; i < result.voxels.size(); ++i)
    if (strong.voxels[i] != 0) result.voxels[i] = 1;
  return result;
}

/// The parts of a mask in which there is something of another one.
Mask parts_with(const Mask& mask, const Mask& core) {
  const Components parts(mask);
  std::vector<bool> keep(static_cast<std::size_t>(parts.count()));
  for (const Components::Run& run : parts.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i)
      if (core.voxels[static_cast<std::size_t>(i)] != 0) keep[static_cast<std::size_t>(run.component)] = true;
  return parts.select(keep);
}

/// From a voxel of lines one voxel wide that has one neighbour, up to where they fork or end.
std::vector<Index3> dead_end_at(const Mask& lines, Index3 here) {
  std::vector<Index3> end;
  std::vector<Index3> next = neighbours_in(lines, here);
  for (Index3 before = here; next.size() <= 2; next = neighbours_in(lines, here)) {
    end.push_back(here);
    const auto onwards = std::ranges::find_if(next, [&](const Index3& n) { return n != before; });
    if (onwards == next.end()) break;
    before = here;
    here = *onwards;
  }
  return end;
}

/// Takes the dead ends off lines one voxel wide whose mean rise is less, and returns them.
Mask drop_dark_ends(Mask& lines, const std::vector<float>& rise, double least) {
  Mask dark(lines.geometry);
  while (true) {
    std::vector<Index3> found;  // all of them, before what forked here ends here
    for (std::size_t i = 0; i < lines.voxels.size(); ++i) {
      if (lines.voxels[i] == 0) continue;
      const Index3 tip = voxel_at(lines.geometry, static_cast<std::int64_t>(i));
      if (neighbours_in(lines, tip).size() != 1) continue;
      const std::vector<Index3> end = dead_end_at(lines, tip);
      double sum = 0;
      for (const Index3& voxel : end) sum += static_cast<double>(rise[lines.offset(voxel)]);
      if (sum < least * static_cast<double>(end.size())) found.insert(found.end(), end.begin(), end.end());
    }
    if (found.empty()) return dark;
    for (const Index3& voxel : found) lines[voxel] = 0, dark[voxel] = 1;
  }
}

/// The median of values, and the standard deviation that their median absolute deviation stands for.
struct Spread {
  double median, standard_deviation;
};

Spread spread_of(const std::vector<float>& values) {
  const auto median = [](std::vector<float> v) {
    const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
    std::ranges::nth_element(v, middle);
    return static_cast<double>(*middle);
  };
  const double centre = median(values);
  std::vector<float> deviations = values;
  for (float& v : deviations) v = std::abs(v - static_cast<float>(centre));
  return {centre, 1.4826 * median(std::move(deviations))};
}

}  // namespace

bool is_buried_in_noise(const Volume& volume) {
  const auto [lowest, highest] = std::ranges::minmax(volume.hu());
  return measure_noise_hu(volume) > 0.1 * (highest - lowest);
}

std::vector<float> line_strength(const Volume& volume, ComputeDevice& device) {
  constexpr double kAcross_vox = 0.5, kAlong_vox = 3.5;
  constexpr int kDirections = 64;
  return filtered(volume, device, kHalo + kReach_vox, [](BlockFilter& block, const cl::Buffer& values) {
    return block.line_strength(contrast_of(block, values, kAcross_vox), kAlong_vox, kReach_vox, kDirections);
  });
}

std::vector<float> local_rise(const Volume& volume, double across_vox, ComputeDevice& device) {
  std::vector<float> rise = filtered(
      volume, device, kHalo,
      [&](BlockFilter& block, const cl::Buffer& values) { return contrast_of(block, values, across_vox); });
  const auto [median, spread] = spread_of(rise);
  for (float& v : rise) v = spread > 0 ? static_cast<float>((v - median) / spread) : 0;  // mostly padding
  return rise;
}

Mask find_line_vessels(const std::vector<float>& strength, const VolumeGeometry& grid) {
  constexpr double kStrong = 4.25, kWeak = 3;
  constexpr std::int64_t kMinVoxels = 5, kSureVoxels = 2 * kReach_vox;
  const auto [median, spread] = spread_of(strength);
  if (!(spread > 0)) return Mask(grid);  // mostly padding
  const Mask strong = large_parts(above(strength, grid, median + kStrong * spread), kMinVoxels);
  Mask weak = above(strength, grid, median + kWeak * spread);
  for (std::size_t i = 0; i < weak.voxels.size(); ++i)
    if (strong.voxels[i] != 0) weak.voxels[i] = 0;
  return parts_with(with_bridges(strong, weak), large_parts(strong, kSureVoxels));
}

Mask with_lumen(const Mask& lines, const std::vector<float>& rise) {
  constexpr float kEdge = 0.133F;
  constexpr double kMinOfAnEnd = 2.5;
  float brightest = 0;
  for (std::size_t i = 0; i < rise.size(); ++i)
    if (lines.voxels[i] != 0) brightest = std::max(brightest, rise[i]);
  if (!(brightest > 0)) return lines;  // of a scan that is mostly padding nothing more is known
  Mask vessels = thin(lines);
  const Mask dark = drop_dark_ends(vessels, rise, kMinOfAnEnd);
  const std::vector<float> to_vessels_mm = distance_to_mm(vessels), to_dark_mm = distance_to_mm(dark);
  for (std::size_t i = 0; i < rise.size(); ++i) {
    if (rise[i] < kEdge * brightest || to_dark_mm[i] < to_vessels_mm[i]) continue;
    const Index3 voxel = voxel_at(lines.geometry, static_cast<std::int64_t>(i));
    if (lines.voxels[i] != 0 || std::any_of(kNeighbours.begin(), kNeighbours.begin() + 18,
                                            [&](const Index3& step) { return lines.at(voxel + step); }))
      vessels.voxels[i] = 1;
  }
  return vessels;
}

}  // namespace xraycast
