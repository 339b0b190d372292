#include "xraycast/segmentation/bone.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/morphology.hpp"

#include <algorithm>

namespace xraycast {
namespace {

constexpr double kMetal_hu = 2000, kBlooming_mm = 5, kPlaque_mm3 = 100;
constexpr double kClosing_mm = 2;        ///< closes cracks in cortical bone, less than the smallest canal
constexpr double kMarrow_mm2 = 1500;     ///< a vertebral body's section, and far less than a skull's
constexpr double kVesselFraction = 0.3;  ///< of a hole, from which on it is a canal

/// Dense voxels in components too large for plaques, without metal and its blooming. As many units of
/// progress as there are slices.
Mask dense_bone(const Volume& volume, const HuWindow& window, Progress& progress) {
  const std::int64_t slices = volume.geometry().size.z;
  Mask dense = between(volume, window.high_hu, 32767);
  progress.advance(slices / 4);
  subtract(dense, dilated_by_cylinder(between(volume, kMetal_hu, 32767), kBlooming_mm));
  progress.advance(slices / 2);
  const Components components(dense);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  for (int c = 0; c < components.count(); ++c)
    keep[static_cast<std::size_t>(c)] =
        static_cast<double>(components.voxels(c)) * voxel_mm3(volume.geometry()) >= kPlaque_mm3;
  progress.advance(slices - slices / 4 - slices / 2);
  return components.select(keep);
}

}  // namespace

Mask find_bone(const Volume& volume, const HuWindow& window, const Mask& vessels, Progress& progress) {
  const SliceMorphology& morphology = slice_morphology();
  const std::int64_t slices = volume.geometry().size.z;
  progress.begin("removing bone", 2 * slices, "slices");
  Mask bone = dense_bone(volume, window, progress), closed = bone;
  const VolumeGeometry& g = volume.geometry();
  const StructuringElement closing = disc(g, kClosing_mm), rim{StructuringElement::Shape::ellipse, 3, 3};
  const double pixel_mm2 = g.spacing_mm.x * g.spacing_mm.y;
  parallel_for(g.size.z, [&](std::int64_t z) {
    const MaskSlice slice = slice_of(bone, z), outline = slice_of(closed, z);
    progress.advance();
    if (is_empty(slice)) return;
    morphology.close(outline, closing);
    const std::uint8_t* const vessel = &vessels.voxels[vessels.offset({0, 0, z})];
    morphology.for_each_hole(outline, [&](std::span<const int> hole) {
      const auto area = static_cast<double>(hole.size());
      if (area * pixel_mm2 > kMarrow_mm2) return;
      const auto bright = std::ranges::count_if(hole, [&](int offset) { return vessel[offset] != 0; });
      if (static_cast<double>(bright) >= kVesselFraction * area) return;
      for (const int offset : hole) slice.voxels[offset] = 1;
    });
    morphology.dilate(slice, rim);
  });
  return bone;
}

void remove_marrow(Mask& mask, const Mask& bone) {
  const Components components(mask);
  std::vector<std::int64_t> faces(static_cast<std::size_t>(components.count())), on_bone(faces.size());
  for (const Components::Run& run : components.runs()) {
    const Index3 first = voxel_at(mask.geometry, run.first);
    for (std::int64_t i = 0; i < run.length; ++i)
      for (std::size_t n = 0; n < 6; ++n) {
        const Index3 near = first + Index3(i, 0, 0) + kNeighbours[n];
        if (mask.at(near)) continue;
        ++faces[static_cast<std::size_t>(run.component)];
        if (bone.at(near)) ++on_bone[static_cast<std::size_t>(run.component)];
      }
  }
  std::vector<bool> keep(faces.size());
  for (std::size_t c = 0; c < keep.size(); ++c) keep[c] = 2 * on_bone[c] <= faces[c];
  mask = components.select(keep);
}

}  // namespace xraycast
