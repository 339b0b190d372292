#include "xraycast/mask/mask.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>

namespace xraycast {

const std::array<Index3, 26> kNeighbours = {{
    {-1, 0, 0},   {1, 0, 0},   {0, -1, 0},  {0, 1, 0},  {0, 0, -1},  {0, 0, 1},                          //
    {-1, -1, 0},  {1, -1, 0},  {-1, 1, 0},  {1, 1, 0},  {-1, 0, -1}, {1, 0, -1},                         //
    {-1, 0, 1},   {1, 0, 1},   {0, -1, -1}, {0, 1, -1}, {0, -1, 1},  {0, 1, 1},                          //
    {-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {-1, 1, 1}, {1, 1, 1},  //
}};

std::int64_t Mask::count() const {
  std::atomic<std::int64_t> total{0};
  const auto slice = static_cast<std::size_t>(geometry.slice_voxels());
  parallel_for(geometry.size.z, [&](std::int64_t z) {
    const auto first = voxels.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(z) * slice);
    total += std::count(first, first + static_cast<std::ptrdiff_t>(slice), 1);
  });
  return total;
}

Box bounding_box(const Mask& mask) {
  const Index3 size = mask.geometry.size;
  Box box{size, {0, 0, 0}};
  std::mutex mutex;
  parallel_for(size.z, [&](std::int64_t z) {
    Box of_slice{size, {0, 0, 0}};
    for (std::int64_t y = 0; y < size.y; ++y) {
      const std::uint8_t* row = &mask.voxels[mask.offset({0, y, z})];
      const auto* first =
          static_cast<const std::uint8_t*>(std::memchr(row, 1, static_cast<std::size_t>(size.x)));
      if (first == nullptr) continue;
      std::int64_t last = size.x - 1;
      while (row[last] == 0) --last;
      of_slice.lower = glm::min(of_slice.lower, Index3(first - row, y, z));
      of_slice.upper = glm::max(of_slice.upper, Index3(last + 1, y + 1, z + 1));
    }
    const std::lock_guard lock(mutex);
    box.lower = glm::min(box.lower, of_slice.lower);
    box.upper = glm::max(box.upper, of_slice.upper);
  });
  return box;
}

Box grown(const Box& box, std::int64_t margin, const Index3& size) {
  return {glm::max(box.lower - margin, Index3(0)), glm::min(box.upper + margin, size)};
}

Mask crop(const Mask& mask, const Box& box) {
  VolumeGeometry geometry = mask.geometry;
  geometry.size = box.upper - box.lower;
  geometry.origin_mm = mask.geometry.to_world_mm(glm::dvec3(box.lower));
  Mask part(geometry);
  parallel_for(geometry.size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < geometry.size.y; ++y)
      std::copy_n(&mask.voxels[mask.offset(box.lower + Index3(0, y, z))], geometry.size.x,
                  &part.voxels[part.offset({0, y, z})]);
  });
  return part;
}

void paste(const Mask& part, const Box& box, Mask& whole) {
  const Index3 size = part.geometry.size;
  for (std::int64_t z = 0; z < size.z; ++z)
    for (std::int64_t y = 0; y < size.y; ++y)
      std::copy_n(&part.voxels[part.offset({0, y, z})], size.x,
                  &whole.voxels[whole.offset(box.lower + Index3(0, y, z))]);
}

namespace {

/// Calls `change(voxel of mask, voxel of other)` for all voxels, slices in parallel.
template <typename Change>
void combine(Mask& mask, const Mask& other, const Change& change) {
  const auto slice = static_cast<std::size_t>(mask.geometry.slice_voxels());
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    const std::size_t first = static_cast<std::size_t>(z) * slice;
    for (std::size_t i = first; i < first + slice; ++i) change(mask.voxels[i], other.voxels[i]);
  });
}

}  // namespace

void unite(Mask& mask, const Mask& other) {
  combine(mask, other, [](std::uint8_t& voxel, std::uint8_t its) { voxel |= its; });
}

void intersect(Mask& mask, const Mask& other) {
  combine(mask, other, [](std::uint8_t& voxel, std::uint8_t its) { voxel &= its; });
}

void subtract(Mask& mask, const Mask& other) {
  combine(mask, other,
          [](std::uint8_t& voxel, std::uint8_t its) { voxel &= static_cast<std::uint8_t>(its ^ 1); });
}

bool touches(const Mask& mask, const Index3& voxel, Sharing sharing) {
  return std::any_of(kNeighbours.begin(), kNeighbours.begin() + static_cast<std::ptrdiff_t>(sharing),
                     [&](const Index3& step) { return mask.at(voxel + step); });
}

std::vector<Index3> neighbours_in(const Mask& mask, const Index3& voxel) {
  std::vector<Index3> list;
  for (const Index3& step : kNeighbours)
    if (mask.at(voxel + step)) list.push_back(voxel + step);
  return list;
}

}  // namespace xraycast
