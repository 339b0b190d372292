#include "xraycast/mask/morphology.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

MaskSlice slice_of(Mask& mask, std::int64_t z) {
  return {&mask.voxels[mask.offset({0, 0, z})], static_cast<int>(mask.geometry.size.x),
          static_cast<int>(mask.geometry.size.y)};
}

bool is_empty(const MaskSlice& slice) {
  const auto voxels = static_cast<std::ptrdiff_t>(slice.columns) * slice.rows;
  return std::all_of(slice.voxels, slice.voxels + voxels, [](std::uint8_t voxel) { return voxel == 0; });
}

StructuringElement disc(const VolumeGeometry& grid, double radius_mm) {
  const int x = std::max(1, static_cast<int>(std::lround(radius_mm / grid.spacing_mm.x))),
            y = std::max(1, static_cast<int>(std::lround(radius_mm / grid.spacing_mm.y)));
  return {StructuringElement::Shape::ellipse, 2 * x + 1, 2 * y + 1};
}

Mask dilated(const Mask& mask, Sharing sharing) {
  Mask result = mask;
  for_each_voxel(grown(bounding_box(mask), 1, mask.geometry.size), [&](const Index3& voxel) {
    if (mask[voxel] == 0) result[voxel] = touches(mask, voxel, sharing);
  });
  return result;
}

Mask eroded(const Mask& mask, Sharing sharing) {
  Mask result(mask.geometry);
  const auto last = kNeighbours.begin() + static_cast<std::ptrdiff_t>(sharing);
  for_each_voxel(bounding_box(mask), [&](const Index3& voxel) {
    result[voxel] = mask[voxel] != 0 && std::all_of(kNeighbours.begin(), last, [&](const Index3& step) {
                      return !mask.contains(voxel + step) || mask[voxel + step] != 0;
                    });
  });
  return result;
}

Mask dilated_by_cylinder(const Mask& mask, double radius_mm) {
  const SliceMorphology& morphology = slice_morphology();
  const VolumeGeometry& g = mask.geometry;
  Mask wide = mask, result(g);
  const auto reach = static_cast<std::int64_t>(std::lround(radius_mm / g.spacing_mm.z));
  const Box box = bounding_box(mask);
  const StructuringElement around = disc(g, radius_mm);
  parallel_for(box.upper.z - box.lower.z,
               [&](std::int64_t i) { morphology.dilate(slice_of(wide, box.lower.z + i), around); });
  const std::int64_t pixels = g.size.x * g.size.y;
  parallel_for(g.size.z, [&](std::int64_t z) {
    std::uint8_t* const slice = slice_of(result, z).voxels;
    for (std::int64_t k = std::max(box.lower.z, z - reach); k <= std::min(box.upper.z - 1, z + reach); ++k) {
      const std::uint8_t* const near = slice_of(wide, k).voxels;
      for (std::int64_t i = 0; i < pixels; ++i) slice[i] |= near[i];
    }
  });
  return result;
}

void fill_holes(Mask& mask, double max_area_mm2) {
  const SliceMorphology& morphology = slice_morphology();
  const double pixel_mm2 = mask.geometry.spacing_mm.x * mask.geometry.spacing_mm.y;
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    const MaskSlice slice = slice_of(mask, z);
    if (is_empty(slice)) return;
    morphology.for_each_hole(slice, [&](std::span<const int> hole) {
      if (static_cast<double>(hole.size()) * pixel_mm2 > max_area_mm2) return;
      for (const int offset : hole) slice.voxels[offset] = 1;
    });
  });
}

}  // namespace xraycast
