#include "xraycast/line_filter.hpp"

#include "xraycast/block_filter.hpp"
#include "xraycast/contrast.hpp"
#include "xraycast/parallel.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace xraycast {
namespace {

constexpr std::int64_t kSlabSlices = 64, kHalo = 8;  ///< a slab of 512 x 512 takes 80 MB a buffer

/// Filters a scan slab by slab, with `kHalo` slices more on each side.
Volume filtered(const Volume& volume, Device& device,
                const std::function<cl::Buffer(BlockFilter&, const cl::Buffer&)>& filter) {
  const VolumeGeometry& g = volume.geometry();
  Volume result(g);
  for (std::int64_t first = 0; first < g.size.z; first += kSlabSlices) {
    const std::int64_t begin = std::max<std::int64_t>(0, first - kHalo),
                       end = std::min(g.size.z, first + kSlabSlices + kHalo),
                       last = std::min(g.size.z, first + kSlabSlices);
    const auto hu = volume.slices(begin, end - begin);
    std::vector<float> values(hu.begin(), hu.end());
    BlockFilter block(device, {g.size.x, g.size.y, end - begin});
    values = block.download(filter(block, block.upload(values)));
    const float* from = &values[static_cast<std::size_t>((first - begin) * g.slice_voxels())];
    std::int16_t* to = &result.hu()[static_cast<std::size_t>(first * g.slice_voxels())];
    std::transform(from, from + (last - first) * g.slice_voxels(), to,
                   [](float v) { return static_cast<std::int16_t>(std::lround(v)); });
  }
  return result;
}

}  // namespace

std::optional<Volume> denoised(const Volume& volume, Device& device) {
  const double noise_hu = measure_noise_hu(volume);
  const auto [lowest, highest] = std::ranges::minmax(volume.hu());
  // A scan whose whole range is ten standard deviations of its noise or less has its vessels within the reach
  // of noise (four above the background, four below the lumen); nothing but averaging along vessels parts
  // them.
  if (noise_hu > 0.1 * (highest - lowest))
    return filtered(volume, device, [](BlockFilter& block, const cl::Buffer& values) {
      // Across the line a narrow Gaussian less a wide one, so that what is bright all around does not count.
      constexpr double kAcross_vox = 0.5, kAround_vox = 3, kAlong_vox = 2.2;
      constexpr int kDirections = 64;
      std::vector<float> narrow = block.download(block.smooth(values, glm::dvec3(kAcross_vox)));
      const std::vector<float> wide = block.download(block.smooth(values, glm::dvec3(kAround_vox)));
      for (std::size_t i = 0; i < narrow.size(); ++i) narrow[i] -= wide[i];
      return block.line_mean(block.upload(narrow), kAlong_vox, kDirections);
    });
  // A vessel's core begins 30 % of the contrast below its CT number (see window_of): 75 HU in the weakest
  // angiography, of 250 HU. While that is two standard deviations, thresholds lose one voxel in forty.
  constexpr double kGood_hu = 0.3 * 250 / 2;
  if (noise_hu > kGood_hu)
    return filtered(volume, device, [](BlockFilter& block, const cl::Buffer& values) {
      return block.smooth(values, glm::dvec3(0.7));
    });
  return std::nullopt;
}

}  // namespace xraycast
