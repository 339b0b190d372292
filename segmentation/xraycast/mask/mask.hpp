#pragma once

#include "xraycast/base/parallel.hpp"
#include "xraycast/volume/volume.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace xraycast {

/// A voxel's place among those of a grid, x fastest.
inline std::size_t offset_of(const VolumeGeometry& grid, const Index3& voxel) {
  return static_cast<std::size_t>((voxel.z * grid.size.y + voxel.y) * grid.size.x + voxel.x);
}

/// A binary mask on a volume's grid: 1 inside, 0 outside, x fastest. Beyond the grid is outside.
struct Mask {
  VolumeGeometry geometry;
  std::vector<std::uint8_t> voxels;

  /// An empty mask on a grid.
  explicit Mask(const VolumeGeometry& grid)
      : geometry(grid), voxels(static_cast<std::size_t>(grid.voxel_count())) {}

  std::size_t offset(const Index3& i) const { return offset_of(geometry, i); }
  bool contains(const Index3& i) const {
    return i.x >= 0 && i.y >= 0 && i.z >= 0 && i.x < geometry.size.x && i.y < geometry.size.y &&
           i.z < geometry.size.z;
  }
  std::uint8_t& operator[](const Index3& i) { return voxels[offset(i)]; }
  std::uint8_t operator[](const Index3& i) const { return voxels[offset(i)]; }
  bool at(const Index3& i) const { return contains(i) && (*this)[i] != 0; }

  std::int64_t count() const;
};

/// The voxel at an offset, x fastest.
inline Index3 voxel_at(const VolumeGeometry& grid, std::int64_t offset) {
  const Index3& size = grid.size;
  return {offset % size.x, offset / size.x % size.y, offset / (size.x * size.y)};
}

inline double voxel_mm3(const VolumeGeometry& grid) {
  return grid.spacing_mm.x * grid.spacing_mm.y * grid.spacing_mm.z;
}

/// Voxels from `lower` up to, but not including, `upper`.
struct Box {
  Index3 lower{0, 0, 0}, upper{0, 0, 0};
  bool empty() const { return upper.x <= lower.x || upper.y <= lower.y || upper.z <= lower.z; }
};

/// Encloses all voxels of a mask; empty for an empty one.
Box bounding_box(const Mask& mask);

/// Grown by `margin` voxels, clipped to the grid.
Box grown(const Box& box, std::int64_t margin, const Index3& size);

/// The part of a mask in a box, at the same place in space.
Mask crop(const Mask& mask, const Box& box);

/// Puts `part`, cropped from `box`, back into a mask on the whole grid.
void paste(const Mask& part, const Box& box, Mask& whole);

/// Calls `visit(voxel)` for each voxel of a box, x fastest.
template <typename Visit>
void for_each_voxel_of(const Box& box, const Visit& visit) {
  for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
      for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) visit(Index3(x, y, z));
}

/// The same, slices in parallel.
template <typename Visit>
void for_each_voxel(const Box& box, const Visit& visit) {
  parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
    Box slice = box;
    slice.lower.z += i;
    slice.upper.z = slice.lower.z + 1;
    for_each_voxel_of(slice, visit);
  });
}

/// Sets of the voxels of one grid: adds what is in another mask, keeps only that, or removes it.
void unite(Mask& mask, const Mask& other);
void intersect(Mask& mask, const Mask& other);
void subtract(Mask& mask, const Mask& other);

/// The 26 neighbours of a voxel; the first 6 share a face with it, the next 12 an edge.
extern const std::array<Index3, 26> kNeighbours;

/// How many of kNeighbours share a face with a voxel, a face or an edge, or at least a corner.
enum class Sharing : std::size_t { face = 6, edge = 18, corner = 26 };

/// Whether one of a voxel's neighbours is inside.
bool touches(const Mask& mask, const Index3& voxel, Sharing sharing);

/// Those of a voxel's neighbours that are inside.
std::vector<Index3> neighbours_in(const Mask& mask, const Index3& voxel);

}  // namespace xraycast
