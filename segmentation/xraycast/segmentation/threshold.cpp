#include "xraycast/segmentation/threshold.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

HuWindow window_of(const Contrast& contrast) {
  const double low_hu = contrast.tissue_hu + 0.5 * contrast.step_hu(),
               core_hu = contrast.tissue_hu + 0.7 * contrast.step_hu();
  if (!contrast.has_bone) return {low_hu, core_hu, 32767};
  return {low_hu, core_hu, contrast.vessel_hu + std::max(0.25 * contrast.step_hu(), 3 * contrast.noise_hu)};
}

Mask between(const Volume& volume, double low_hu, double high_hu) {
  Mask mask(volume.geometry());
  const auto low = static_cast<std::int16_t>(std::clamp(std::ceil(low_hu), -32768.0, 32767.0)),
             high = static_cast<std::int16_t>(std::clamp(std::floor(high_hu), -32768.0, 32767.0));
  const std::int64_t slice = volume.geometry().slice_voxels();
  parallel_for(volume.geometry().size.z, [&](std::int64_t z) {
    const std::int16_t* hu = &volume.hu()[static_cast<std::size_t>(z * slice)];
    std::uint8_t* inside = &mask.voxels[static_cast<std::size_t>(z * slice)];
    for (std::int64_t i = 0; i < slice; ++i) inside[i] = hu[i] >= low && hu[i] <= high;
  });
  return mask;
}

Mask threshold(const Volume& volume, const HuWindow& window) {
  const Mask core = between(volume, window.core_hu, window.high_hu);
  Mask mask = core;
  const Index3 size = volume.geometry().size;
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y) {
      const std::size_t row = core.offset({0, y, z});
      for (std::int64_t x = 0; x < size.x; ++x) {
        const std::int16_t hu = volume.hu()[row + static_cast<std::size_t>(x)];
        if (hu < window.low_hu || hu >= window.core_hu) continue;
        for (const Index3& step : kNeighbours)
          if (core.at(Index3(x, y, z) + step)) {
            mask.voxels[row + static_cast<std::size_t>(x)] = 1;
            break;
          }
      }
    }
  });
  return mask;
}

}  // namespace xraycast
