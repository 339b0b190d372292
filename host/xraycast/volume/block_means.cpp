#include "xraycast/volume/block_means.hpp"

#include "xraycast/base/parallel.hpp"

#include <glm/common.hpp>

namespace xraycast {

Volume block_means(const Volume& volume, const Index3& block) {
  const VolumeGeometry& fine = volume.geometry();
  VolumeGeometry cells{glm::max(fine.size / block, Index3(1)), fine.spacing_mm * glm::dvec3(block), {}};
  cells.origin_mm = fine.lower_mm() + 0.5 * cells.spacing_mm;
  const Index3 used = glm::min(block, fine.size);
  Volume coarse(cells);
  parallel_for(cells.size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < cells.size.y; ++y)
      for (std::int64_t x = 0; x < cells.size.x; ++x) {
        std::int64_t sum = 0;
        for (std::int64_t k = 0; k < used.z; ++k)
          for (std::int64_t j = 0; j < used.y; ++j)
            for (std::int64_t i = 0; i < used.x; ++i)
              sum += volume.at(x * block.x + i, y * block.y + j, z * block.z + k);
        coarse.at(x, y, z) = static_cast<std::int16_t>(sum / (used.x * used.y * used.z));
      }
  });
  return coarse;
}

}  // namespace xraycast
