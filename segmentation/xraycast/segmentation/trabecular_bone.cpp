#include "xraycast/segmentation/trabecular_bone.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kMaxThickness_mm = 5;
constexpr double kReach = 4, kMinReach_vox = 8, kFork = 1.75;  ///< see the header
constexpr double kAround_vox = 2.5, kSurrounded = 0.65;        ///< see the header

/// A ball as rows of voxels along x.
class Ball {
 public:
  Ball(const VolumeGeometry& g, double radius_mm) {
    const glm::dvec3 s = g.spacing_mm;
    const auto reach_y = static_cast<std::int64_t>(radius_mm / s.y),
               reach_z = static_cast<std::int64_t>(radius_mm / s.z);
    for (std::int64_t z = -reach_z; z <= reach_z; ++z)
      for (std::int64_t y = -reach_y; y <= reach_y; ++y) {
        const double y_mm = static_cast<double>(y) * s.y, z_mm = static_cast<double>(z) * s.z,
                     left_mm2 = radius_mm * radius_mm - y_mm * y_mm - z_mm * z_mm;
        if (left_mm2 >= 0) rows_.push_back({y, z, static_cast<std::int64_t>(std::sqrt(left_mm2) / s.x)});
      }
  }

  /// Calls `visit(offset of the first voxel, number of voxels)` for each row within the grid.
  template <typename Visit>
  void for_each_row(const Mask& mask, const Index3& centre, const Visit& visit) const {
    const Index3 size = mask.geometry.size;
    for (const Row& row : rows_) {
      const std::int64_t y = centre.y + row.y, z = centre.z + row.z;
      if (y < 0 || z < 0 || y >= size.y || z >= size.z) continue;
      const std::int64_t begin = std::max<std::int64_t>(0, centre.x - row.reach),
                         end = std::min(size.x, centre.x + row.reach + 1);
      visit(mask.offset({begin, y, z}), end - begin);
    }
  }

 private:
  struct Row {
    std::int64_t y, z, reach;
  };
  std::vector<Row> rows_;
};

/// Prefix sums along rows: how many voxels of the mask lie in a row before each of its voxels.
std::vector<std::uint16_t> row_prefix_sums(const Mask& mask) {
  std::vector<std::uint16_t> counts(mask.voxels.size());
  const Index3 size = mask.geometry.size;
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y) {
      std::uint16_t count = 0;
      const std::size_t row = mask.offset({0, y, z});
      for (std::size_t i = row; i < row + static_cast<std::size_t>(size.x); ++i) {
        counts[i] = count;
        count = static_cast<std::uint16_t>(count + mask.voxels[i]);
      }
    }
  });
  return counts;
}

/// A voxel of the medial axis: a local maximum of the distance transform.
struct MedialVoxel {
  Index3 voxel;
  double depth_mm;
};

std::vector<MedialVoxel> medial_voxels(const Mask& mask) {
  const std::vector<float> depth_mm = distance_to_background_mm(mask);
  std::vector<std::vector<MedialVoxel>> of_slice(static_cast<std::size_t>(mask.geometry.size.z));
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < mask.geometry.size.y; ++y)
      for (std::int64_t x = 0; x < mask.geometry.size.x; ++x) {
        const Index3 here(x, y, z);
        const float mm = depth_mm[mask.offset(here)];
        if (mm > 0 && std::ranges::none_of(kNeighbours, [&](const Index3& step) {
              return mask.contains(here + step) && depth_mm[mask.offset(here + step)] > mm;
            }))
          of_slice[static_cast<std::size_t>(z)].push_back({here, mm});
      }
  });
  std::vector<MedialVoxel> all;
  for (const auto& slice : of_slice) all.insert(all.end(), slice.begin(), slice.end());
  return all;
}

bool is_plate_like(const MedialVoxel& m, const Mask& mask, const std::vector<std::uint16_t>& counts,
                   double voxel_mm) {
  const double reach_mm = std::max(kReach * m.depth_mm + voxel_mm, kMinReach_vox * voxel_mm),
               radius_mm = m.depth_mm + (m.depth_mm > voxel_mm ? 0.5 : 0.25) * voxel_mm,
               tube_mm3 = std::numbers::pi * radius_mm * radius_mm * 2 * reach_mm;
  std::int64_t inside = 0;
  Ball(mask.geometry, reach_mm).for_each_row(mask, m.voxel, [&](std::size_t first, std::int64_t length) {
    const std::size_t last = first + static_cast<std::size_t>(length) - 1;
    inside += counts[last] - counts[first] + mask.voxels[last];
  });
  return static_cast<double>(inside) * voxel_mm3(mask.geometry) > kFork * tube_mm3;
}

bool is_enclosed_by_bone(const MedialVoxel& m, const Mask& mask, const Mask& bone, double voxel_mm) {
  std::int64_t around = 0, on_bone = 0;
  const Ball ball(mask.geometry, m.depth_mm + kAround_vox * voxel_mm);
  ball.for_each_row(mask, m.voxel, [&](std::size_t first, std::int64_t length) {
    for (std::size_t i = first; i < first + static_cast<std::size_t>(length); ++i) {
      around += mask.voxels[i] ^ 1;
      on_bone += (mask.voxels[i] ^ 1) & bone.voxels[i];
    }
  });
  return static_cast<double>(on_bone) > kSurrounded * static_cast<double>(around);
}

}  // namespace

Mask find_trabecular_bone(const Mask& mask, const Mask& bone, Progress& progress) {
  Mask result(mask.geometry);
  const Box box = grown(bounding_box(mask), 1, mask.geometry.size);
  if (box.empty()) return result;
  const Mask part = crop(mask, box), bone_part = crop(bone, box);
  const VolumeGeometry& g = part.geometry;
  const double voxel_mm = std::cbrt(voxel_mm3(g));
  const std::vector<MedialVoxel> medial = medial_voxels(part);
  progress.advance();
  const auto is_thin = [](const MedialVoxel& m) { return m.depth_mm <= 0.5 * kMaxThickness_mm; };
  const auto paint = [&](Mask& mask_of_balls, const MedialVoxel& m, double radius_mm, std::uint8_t value) {
    Ball(g, radius_mm).for_each_row(part, m.voxel, [&](std::size_t first, std::int64_t length) {
      std::fill_n(mask_of_balls.voxels.begin() + static_cast<std::ptrdiff_t>(first), length, value);
    });
  };
  // A vessel that leaves one twice as thick does not form a plate with it.
  Mask thin = part;
  for (const MedialVoxel& m : medial)
    if (m.depth_mm > kMaxThickness_mm) paint(thin, m, m.depth_mm + voxel_mm, 0);
  const std::vector<std::uint16_t> counts = row_prefix_sums(thin);
  progress.advance();

  std::vector<std::uint8_t> is_trabecular(medial.size());
  parallel_for(static_cast<std::int64_t>(medial.size()), [&](std::int64_t i) {
    const MedialVoxel& m = medial[static_cast<std::size_t>(i)];
    if (is_thin(m))
      is_trabecular[static_cast<std::size_t>(i)] =
          is_plate_like(m, thin, counts, voxel_mm) || is_enclosed_by_bone(m, part, bone_part, voxel_mm);
  });

  progress.advance();
  Mask found(g);
  for (std::size_t i = 0; i < medial.size(); ++i)
    if (is_trabecular[i] != 0) paint(found, medial[i], medial[i].depth_mm + voxel_mm, 1);
  for (const MedialVoxel& m : medial)
    if (!is_thin(m)) paint(found, m, m.depth_mm, 0);
  intersect(found, part);
  paste(found, box, result);
  progress.advance();
  return result;
}

}  // namespace xraycast
