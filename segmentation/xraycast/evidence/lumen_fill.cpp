#include "xraycast/evidence/lumen_fill.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/morphology.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <optional>

namespace xraycast {
namespace {

/// The CT number below which a fraction of the scan's voxels lie that `counts` accepts; nothing without any.
template <typename Counts>
std::optional<double> quantile_hu(const Volume& volume, const Box& box, double fraction,
                                  const Counts& counts) {
  std::vector<std::int64_t> histogram(65536);
  std::mutex mutex;
  parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
    std::vector<std::int64_t> here(histogram.size());
    const std::int64_t z = box.lower.z + i;
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
      for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
        if (counts(Index3(x, y, z))) ++here[static_cast<std::size_t>(volume.at(x, y, z) + 32768)];
    const std::lock_guard lock(mutex);
    std::ranges::transform(here, histogram, histogram.begin(), std::plus());
  });
  const auto all = static_cast<double>(std::reduce(histogram.begin(), histogram.end()));
  if (all == 0) return std::nullopt;
  std::size_t bin = 0;
  for (double sum = static_cast<double>(histogram[0]); sum <= fraction * all && bin + 1 < histogram.size();)
    sum += static_cast<double>(histogram[++bin]);
  return static_cast<double>(bin) - 32768;
}

/// The mean CT number of the full voxels up to two voxels away.
std::optional<double> lumen_near_hu(const Volume& volume, const Mask& full, const Index3& voxel) {
  constexpr std::int64_t kReach = 2;
  const Index3 lower = glm::max(voxel - kReach, Index3(0)),
               upper = glm::min(voxel + kReach, full.geometry.size - Index3(1));
  double sum = 0;
  int count = 0;
  for (std::int64_t z = lower.z; z <= upper.z; ++z)
    for (std::int64_t y = lower.y; y <= upper.y; ++y)
      for (std::int64_t x = lower.x; x <= upper.x; ++x)
        if (full[{x, y, z}] != 0) sum += volume.at(x, y, z), ++count;
  if (count == 0) return std::nullopt;
  return sum / count;
}

}  // namespace

double LumenFill::volume_mm3() const {
  const glm::dvec3 s = geometry.spacing_mm;
  return std::accumulate(fractions.begin(), fractions.end(), 0.0) * s.x * s.y * s.z / kFull;
}

std::uint8_t quantised_fraction(double fraction) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(fraction, 0.0, 1.0) * LumenFill::kFull));
}

LumenFill fill_of(const Volume& volume, const Mask& mask) {
  LumenFill fill(mask.geometry);
  const Box box = grown(bounding_box(mask), 2, mask.geometry.size);
  if (box.empty()) return fill;
  const Mask full = eroded(mask, Sharing::corner), wall = dilated(mask, Sharing::corner),
             beside = dilated(wall, Sharing::corner);
  const auto tissue_hu =
      quantile_hu(volume, box, 0.5, [&](const Index3& v) { return beside[v] != 0 && wall[v] == 0; });
  auto lumen_hu = quantile_hu(volume, box, 0.5, [&](const Index3& v) { return full[v] != 0; });
  constexpr double kBrightest = 0.95;  // of vessels that have no full voxel
  if (!lumen_hu)
    lumen_hu = quantile_hu(volume, box, kBrightest, [&](const Index3& v) { return mask[v] != 0; });
  constexpr double kLeast_hu =
      1;  // a scan that does not show the mask's vessels says nothing about their walls
  const bool shows_vessels = tissue_hu && *lumen_hu - *tissue_hu > kLeast_hu;
  for_each_voxel(box, [&](const Index3& voxel) {
    if (wall[voxel] == 0) return;
    double fraction = mask[voxel];
    if (full[voxel] == 0 && shows_vessels) {
      const double here_hu = volume.at(voxel.x, voxel.y, voxel.z),
                   rise_hu =
                       std::max(lumen_near_hu(volume, full, voxel).value_or(*lumen_hu) - *tissue_hu, 1.0);
      fraction = (here_hu - *tissue_hu) / rise_hu;
      if (mask[voxel] == 0 && fraction > 0.5) fraction = 0;
    }
    fill.fractions[mask.offset(voxel)] = quantised_fraction(fraction);
  });
  return fill;
}

}  // namespace xraycast
