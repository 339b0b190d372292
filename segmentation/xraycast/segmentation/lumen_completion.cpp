#include "xraycast/segmentation/lumen_completion.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

void add_partial_volume_rim(const Mask& bright, Mask& vessels) {
  const Mask before = vessels;
  const Index3 size = vessels.geometry.size;
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x) {
        const Index3 here(x, y, z);
        if (bright[here] == 0 || before[here] != 0) continue;
        vessels[here] = std::any_of(kNeighbours.begin(), kNeighbours.begin() + 6,
                                    [&](const Index3& step) { return before.at(here + step); });
      }
  });
}

void add_dense_wall(const Volume& volume, const HuWindow& window, const Mask& bone, Mask& vessels) {
  constexpr double kWall_mm = 1.5;
  const VolumeGeometry& g = volume.geometry();
  const auto steps =
      std::max(1L, std::lround(kWall_mm / std::max({g.spacing_mm.x, g.spacing_mm.y, g.spacing_mm.z})));
  const Box box = grown(bounding_box(vessels), steps, g.size);
  for (long step = 0; step < steps; ++step) {
    const Mask before = vessels;
    parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
      const std::int64_t z = box.lower.z + i;
      for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
        for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
          const Index3 here(x, y, z);
          if (before[here] != 0 || volume.at(x, y, z) < window.high_hu || bone[here] != 0) continue;
          vessels[here] =
              std::ranges::any_of(kNeighbours, [&](const Index3& d) { return before.at(here + d); });
        }
    });
  }
}

}  // namespace xraycast
