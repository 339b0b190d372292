#include "xraycast/attenuation/vessel_removal.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// The fraction of a voxel's contrast agent that is removed: 1 inside the mask, less with the distance to its
/// nearest voxel.
double share(const Volume& mask, const Index3& voxel) {
  if (mask.at(voxel.x, voxel.y, voxel.z) > 0) return 1;
  const Index3 size = mask.geometry().size;
  std::int64_t nearest2 = 4;
  for (std::int64_t dz = -1; dz <= 1; ++dz)
    for (std::int64_t dy = -1; dy <= 1; ++dy)
      for (std::int64_t dx = -1; dx <= 1; ++dx) {
        const std::int64_t x = voxel.x + dx, y = voxel.y + dy, z = voxel.z + dz;
        if (x >= 0 && y >= 0 && z >= 0 && x < size.x && y < size.y && z < size.z && mask.at(x, y, z) > 0)
          nearest2 = std::min(nearest2, dx * dx + dy * dy + dz * dz);
      }
  return 1 - 0.5 * std::sqrt(static_cast<double>(nearest2));
}

}  // namespace

WithoutVessels::WithoutVessels(std::unique_ptr<SliceSource> scan, Volume mask)
    : scan_(std::move(scan)), mask_(std::move(mask)) {
  check_mask_grid(mask_.geometry(), scan_->geometry(), "vessel mask");
}

std::int64_t WithoutVessels::read(std::span<std::int16_t> hu, Progress& progress) {
  const std::int64_t count = scan_->read(hu, progress);
  const auto slice = static_cast<std::size_t>(geometry().slice_voxels());
  parallel_for(count, [&](std::int64_t i) {
    fill(next_ + i, hu.subspan(static_cast<std::size_t>(i) * slice, slice));
  });
  next_ += count;
  return count;
}

void WithoutVessels::fill(std::int64_t z, std::span<std::int16_t> slice) const {
  const Index3 size = geometry().size;
  for (std::int64_t y = 0; y < size.y; ++y)
    for (std::int64_t x = 0; x < size.x; ++x) {
      std::int16_t& hu = slice[static_cast<std::size_t>(y * size.x + x)];
      const bool is_inside = mask_.at(x, y, z) > 0;
      if (is_inside || hu > kBloodHu)
        hu = static_cast<std::int16_t>(std::lround(hu + share(mask_, {x, y, z}) * (kBloodHu - hu)));
    }
}

}  // namespace xraycast
