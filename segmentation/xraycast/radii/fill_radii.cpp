#include "xraycast/radii/fill_radii.hpp"

#include "xraycast/mask/mask.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>

namespace xraycast {
namespace {

/// The voxels that hold lumen, and the point of the tree that each belongs to.
class LumenOwners {
 public:
  explicit LumenOwners(const LumenFill& fill) : fill_(fill) {
    const Mask filled = filled_voxels(fill);
    box_ = bounding_box(filled);
    part_ = crop(filled, box_);
    distance_mm_.assign(part_.voxels.size(), std::numeric_limits<float>::infinity());
    owner_.assign(part_.voxels.size(), -1);
  }

  /// Lets a point own the voxels around it that are nearer to it than to those before.
  void add(std::int32_t point, const VesselPoint& at) {
    constexpr double kBeyond_vox = 3;
    const glm::dvec3 s = part_.geometry.spacing_mm, centre = part_.geometry.to_index(at.position_mm),
                     reach = glm::dvec3(at.radius_mm) / s + kBeyond_vox;
    const Index3 lower = glm::max(Index3(glm::ceil(centre - reach)), Index3(0)),
                 upper = glm::min(Index3(glm::floor(centre + reach)), part_.geometry.size - Index3(1));
    for (std::int64_t z = lower.z; z <= upper.z; ++z)
      for (std::int64_t y = lower.y; y <= upper.y; ++y)
        for (std::int64_t x = lower.x; x <= upper.x; ++x) {
          const std::size_t i = part_.offset({x, y, z});
          if (part_.voxels[i] == 0) continue;
          const auto mm = static_cast<float>(glm::length(s * (glm::dvec3(x, y, z) - centre)) - at.radius_mm);
          if (mm < distance_mm_[i]) distance_mm_[i] = mm, owner_[i] = point;
        }
  }

  /// The lumen that each of `count` points owns.
  std::vector<double> lumen_mm3(std::size_t count) const {
    const glm::dvec3 s = part_.geometry.spacing_mm;
    std::vector<double> sums(count);
    for (std::size_t i = 0; i < owner_.size(); ++i) {
      if (owner_[i] < 0) continue;
      const Index3 voxel = voxel_at(part_.geometry, static_cast<std::int64_t>(i)) + box_.lower;
      sums[static_cast<std::size_t>(owner_[i])] +=
          fill_.fractions[offset_of(fill_.geometry, voxel)] * s.x * s.y * s.z / LumenFill::kFull;
    }
    return sums;
  }

 private:
  static Mask filled_voxels(const LumenFill& fill) {
    Mask mask(fill.geometry);
    std::ranges::transform(fill.fractions, mask.voxels.begin(),
                           [](std::uint8_t fraction) { return static_cast<std::uint8_t>(fraction > 0); });
    return mask;
  }

  const LumenFill& fill_;
  Box box_;
  Mask part_{VolumeGeometry{}};
  std::vector<float> distance_mm_;
  std::vector<std::int32_t> owner_;
};

/// How much of a branch's length each of its points stands for.
std::vector<double> lengths_mm(const std::vector<VesselPoint>& points) {
  std::vector<double> lengths(points.size());
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double half_mm = 0.5 * glm::distance(points[i - 1].position_mm, points[i].position_mm);
    lengths[i - 1] += half_mm;
    lengths[i] += half_mm;
  }
  return lengths;
}

/// The weighted sum of values before and after each, fewer near the ends. Weights fall off, because a point
/// owns one slice of voxels or two.
std::vector<double> sums_around(const std::vector<double>& values, int reach) {
  const auto count = static_cast<int>(values.size());
  std::vector<double> sums(values.size());
  for (int i = 0; i < count; ++i)
    for (int k = std::max(i - reach, 0); k <= std::min(i + reach, count - 1); ++k)
      sums[static_cast<std::size_t>(i)] +=
          (reach + 1 - std::abs(k - i)) * values[static_cast<std::size_t>(k)];
  return sums;
}

void set_radii(const std::vector<double>& lumen_mm3, double voxel_mm, double widest_vox,
               std::vector<VesselPoint>& points) {
  constexpr int kReach = 5;
  constexpr double kLeast_vox = 0.2;
  const std::vector<double> volumes_mm3 = sums_around(lumen_mm3, kReach),
                            along_mm = sums_around(lengths_mm(points), kReach);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double area_mm2 = volumes_mm3[i] / along_mm[i],
                 radius_mm = std::max(std::sqrt(area_mm2 / std::numbers::pi), kLeast_vox * voxel_mm),
                 width_vox = points[i].radius_mm / voxel_mm,
                 of_mask = glm::clamp(width_vox - widest_vox, 0.0, 1.0);
    points[i].radius_mm = glm::mix(radius_mm, points[i].radius_mm, of_mask);
  }
}

}  // namespace

void radii_from_fill(const LumenFill& fill, std::vector<VesselBranch>& branches) {
  if (std::ranges::all_of(fill.fractions, [](std::uint8_t fraction) { return fraction == 0; })) return;
  LumenOwners owners(fill);
  std::int32_t count = 0;
  for (const VesselBranch& branch : branches) {
    check_cancelled();
    for (const VesselPoint& point : branch.points) owners.add(count++, point);
  }
  const std::vector<double> lumen_mm3 = owners.lumen_mm3(static_cast<std::size_t>(count));
  const double widest_vox = fill.is_of_touched_voxels ? 4.5 : 1;
  const glm::dvec3 s = fill.geometry.spacing_mm;
  auto first = lumen_mm3.begin();
  for (VesselBranch& branch : branches) {
    const auto last = first + static_cast<std::ptrdiff_t>(branch.points.size());
    set_radii({first, last}, std::cbrt(s.x * s.y * s.z), widest_vox, branch.points);
    first = last;
  }
}

}  // namespace xraycast
