#include "xraycast/segmentation/lumen_completion.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

namespace xraycast {
namespace {

/// Adds a layer of voxels for each step: those that join the mask as it was before the step.
template <typename Joins>
void grow(Mask& vessels, long steps, const Joins& joins) {
  const Box box = grown(bounding_box(vessels), steps, vessels.geometry.size);
  for (long step = 0; step < steps; ++step) {
    const Mask before = vessels;
    for_each_voxel(box, [&](const Index3& here) {
      if (before[here] == 0) vessels[here] = joins(before, here);
    });
  }
}

/// How many voxels of a size a width in mm has; at least one.
long steps_of(double width_mm, double voxel_mm) { return std::max(1L, std::lround(width_mm / voxel_mm)); }

std::ptrdiff_t touched(const Mask& lumen, const Index3& here) {
  return std::ranges::count_if(kNeighbours, [&](const Index3& step) { return lumen.at(here + step); });
}

/// Whether a voxel is beside a lumen, and not on its way to a stick of noise: it shares a face with a voxel
/// of it, and touches five. A wall's touch nine; those beside a line of single voxels, which touch two others
/// at most, touch two or three.
bool is_beside(const Mask& lumen, const Index3& here) {
  constexpr std::ptrdiff_t kLeastTouched = 5, kLeastOfLine = 2;
  if (!touches(lumen, here, Sharing::face)) return false;
  const std::ptrdiff_t all = touched(lumen, here);
  if (all >= kLeastTouched || all < kLeastOfLine) return all >= kLeastTouched;
  const auto faces = std::span(kNeighbours).first(static_cast<std::size_t>(Sharing::face));
  return std::ranges::all_of(
      faces, [&](const Index3& step) { return !lumen.at(here + step) || touched(lumen, here + step) <= 2; });
}

/// Whether a voxel beside a lumen is brighter than halfway from the darkest voxel to the brightest of the
/// lumen, both within two steps.
bool is_half_filled(const Volume& scan, const Mask& lumen, const Index3& here) {
  if (!is_beside(lumen, here)) return false;
  const double own_hu = scan.at(here.x, here.y, here.z);
  double lumen_hu = own_hu, darkest_hu = own_hu;
  for (const Index3& step : kNeighbours)
    for (const Index3& near : {here + step, here + step + step}) {
      if (!lumen.contains(near)) continue;
      const double hu = scan.at(near.x, near.y, near.z);
      if (lumen[near] != 0)
        lumen_hu = std::max(lumen_hu, hu);
      else
        darkest_hu = std::min(darkest_hu, hu);
    }
  return own_hu > 0.5 * (lumen_hu + darkest_hu);
}

}  // namespace

void add_partial_volume_rim(const Mask& bright, Mask& vessels) {
  grow(vessels, 1, [&](const Mask& before, const Index3& here) {
    return bright[here] != 0 && touches(before, here, Sharing::face);
  });
}

void add_half_filled_rim(const Volume& scan, const Mask& excluded, Mask& vessels) {
  // A seed's tolerance ends 0.8 of the way up an edge: 1.5 mm within its middle as smoothed_for_seeds leaves
  // it, and 2.2 mm where the scan has a blur of a millimetre besides.
  constexpr double kWidth_mm = 2.2;
  const glm::dvec3& s = vessels.geometry.spacing_mm;
  grow(vessels, steps_of(kWidth_mm, std::min({s.x, s.y, s.z})), [&](const Mask& before, const Index3& here) {
    return excluded[here] == 0 && is_half_filled(scan, before, here);
  });
}

void add_dense_wall(const Volume& volume, const HuWindow& window, const Mask& bone, Mask& vessels) {
  constexpr double kWall_mm = 1.5;
  const glm::dvec3& s = volume.geometry().spacing_mm;
  grow(vessels, steps_of(kWall_mm, std::max({s.x, s.y, s.z})), [&](const Mask& before, const Index3& here) {
    return volume.at(here.x, here.y, here.z) >= window.high_hu && bone[here] == 0 &&
           touches(before, here, Sharing::corner);
  });
}

}  // namespace xraycast
