#include "xraycast/segmentation/contrast.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <mutex>
#include <numbers>
#include <optional>
#include <vector>

namespace xraycast {
namespace {

constexpr double kTissueLow_hu = -50, kTissueHigh_hu = 150;
constexpr double kContrastLow_hu = 200, kContrastHigh_hu = 700;
constexpr int kBodySurface_hu = -300;  ///< halfway from air to soft tissue, or nearly

/// How many voxels have each value. Partial volume voxels do not count: their neighbours along the axes
/// differ by more than `edge_hu`.
class Histogram {
 public:
  Histogram(const Volume& volume, int edge_hu) : counts_(65536) {
    const Index3 size = volume.geometry().size;
    std::mutex mutex;
    parallel_for(size.z, [&](std::int64_t z) {
      std::vector<std::uint32_t> counts(65536);
      const std::int64_t below = std::max<std::int64_t>(z - 1, 0), above = std::min(z + 1, size.z - 1);
      for (std::int64_t y = 1; y + 1 < size.y; ++y)
        for (std::int64_t x = 1; x + 1 < size.x; ++x) {
          const int hu = volume.at(x, y, z);
          if (hu > kBodySurface_hu && edge_hu > 0 &&
              (std::abs(volume.at(x + 1, y, z) - volume.at(x - 1, y, z)) > edge_hu ||
               std::abs(volume.at(x, y + 1, z) - volume.at(x, y - 1, z)) > edge_hu ||
               std::abs(volume.at(x, y, above) - volume.at(x, y, below)) > edge_hu))
            continue;
          ++counts[bin_of(hu)];
        }
      const std::lock_guard lock(mutex);
      for (std::size_t i = 0; i < counts.size(); ++i) counts_[i] += counts[i];
    });
  }

  static std::size_t bin_of(int hu) {
    const int bin = hu + 32768;
    return static_cast<std::size_t>(bin);
  }

  double count(int hu) const { return counts_[bin_of(std::clamp(hu, -32768, 32767))]; }

  double between(int first_hu, int last_hu) const {
    double sum = 0;
    for (int hu = first_hu; hu <= last_hu; ++hu) sum += count(hu);
    return sum;
  }

  /// The count around a value, smoothed over `width_hu`.
  double density(int hu, int width_hu) const { return between(hu - width_hu, hu + width_hu); }

  int mode_hu(double low_hu, double high_hu, int width_hu) const {
    int best = static_cast<int>(low_hu);
    for (int hu = best; hu <= high_hu; ++hu)
      if (density(hu, width_hu) > density(best, width_hu)) best = hu;
    return best;
  }

 private:
  std::vector<double> counts_;
};

/// The highest local peak within the range of contrast agent: a value more frequent than all within 60 HU,
/// and half as dense again as the deepest valley between it and soft tissue.
std::optional<double> contrast_peak_hu(const Histogram& histogram, double tissue_hu) {
  constexpr int kWidth_hu = 15, kReach_hu = 60;
  std::optional<int> best;
  double valley = std::numeric_limits<double>::infinity();
  for (int hu = static_cast<int>(tissue_hu) + 50; hu <= kContrastHigh_hu; ++hu) {
    const double here = histogram.density(hu, kWidth_hu);
    valley = std::min(valley, here);
    if (hu < kContrastLow_hu || here < 1.5 * valley || here < 100) continue;
    bool is_peak = true;
    for (int k = 1; k <= kReach_hu && is_peak; ++k)
      is_peak = histogram.density(hu - k, kWidth_hu) <= here && histogram.density(hu + k, kWidth_hu) <= here;
    if (is_peak && (!best || here > histogram.density(*best, kWidth_hu))) best = hu;
  }
  return best;
}

/// The means of two classes, separated by the threshold halfway between them (Ridler and Calvard).
std::optional<std::pair<double, double>> two_classes_hu(const Histogram& histogram, int low_hu, int high_hu) {
  double threshold = 0.5 * (low_hu + high_hu);
  std::pair<double, double> means;
  for (int pass = 0; pass < 100; ++pass) {
    double count[2] = {}, sum[2] = {};
    for (int hu = low_hu; hu <= high_hu; ++hu) {
      const int bright = hu > threshold;
      count[bright] += histogram.count(hu);
      sum[bright] += histogram.count(hu) * hu;
    }
    if (count[0] == 0 || count[1] == 0) return std::nullopt;
    means = {sum[0] / count[0], sum[1] / count[1]};
    const double next = 0.5 * (means.first + means.second);
    if (std::abs(next - threshold) < 0.5) break;
    threshold = next;
  }
  return means;
}

/// The median, and the standard deviation estimated from the median absolute deviation.
std::pair<double, double> median_and_spread_hu(const Histogram& histogram, int low_hu, int high_hu) {
  const double half = 0.5 * histogram.between(low_hu, high_hu);
  int median = low_hu;
  for (double sum = histogram.count(median); sum < half; sum += histogram.count(++median)) {
  }
  int reach = 0;
  while (histogram.between(median - reach, median + reach) < half) ++reach;
  return {median, 1.4826 * reach};
}

/// The standard deviation of what is left of a normal distribution, whose own is 1, once its lowest fraction
/// is cut off (Johnson, Kotz and Balakrishnan, Continuous univariate distributions, 1994, section 13.10.1).
double spread_above(double fraction) {
  double low = -8, high = 8;  // the cut; what lies beyond is less than one in 10^15
  for (int pass = 0; pass < 40; ++pass) {
    const double middle = 0.5 * (low + high);
    (std::erfc(-middle / std::numbers::sqrt2) < 2 * fraction ? low : high) = middle;
  }
  const double density = std::exp(-0.5 * low * low) / std::sqrt(2 * std::numbers::pi),
               mean = density / (1 - fraction);
  return std::sqrt(1 + low * mean - mean * mean);
}

}  // namespace

double measure_noise_hu(const Volume& volume) {
  const Index3 size = volume.geometry().size;
  const auto range = std::ranges::minmax(volume.hu());
  std::vector<std::uint64_t> counts(4096);
  std::uint64_t cut_off = 0;
  std::mutex mutex;
  const std::int64_t step = std::max<std::int64_t>(1, size.z / 50);
  parallel_for((size.z + step - 1) / step, [&](std::int64_t i) {
    std::vector<std::uint64_t> here(counts.size());
    std::uint64_t cut_off_here = 0;
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 1; x + 1 < size.x; ++x) {
        const int a = volume.at(x - 1, y, i * step), b = volume.at(x, y, i * step),
                  c = volume.at(x + 1, y, i * step);
        const auto usable = [&](int hu) { return hu > kBodySurface_hu && hu > range.min && hu < range.max; };
        if (!usable(a) || !usable(c)) continue;
        if (usable(b))
          ++here[static_cast<std::size_t>(std::min(std::abs(a - 2 * b + c), 4095))];
        else if (b == range.min && b > kBodySurface_hu)
          ++cut_off_here;
      }
    const std::lock_guard lock(mutex);
    for (std::size_t k = 0; k < counts.size(); ++k) counts[k] += here[k];
    cut_off += cut_off_here;
  });
  std::uint64_t all = 0, passed = 0;
  for (const std::uint64_t count : counts) all += count;
  std::size_t median = 0;
  while (median + 1 < counts.size() && (passed += counts[median]) * 2 < all) ++median;
  const double seen_hu = 1.4826 * static_cast<double>(median) / std::sqrt(6.0);
  if (all == 0 || cut_off == 0) return seen_hu;
  return seen_hu / spread_above(static_cast<double>(cut_off) / static_cast<double>(cut_off + all));
}

std::optional<Contrast> find_contrast(const Volume& volume, const std::string& name, Progress& progress) {
  const double noise_hu = measure_noise_hu(volume);
  const auto [lowest, highest] = std::ranges::minmax(volume.hu());
  progress.advance();
  const Histogram all(volume, 0);
  progress.advance();
  const double air = all.between(-32768, kBodySurface_hu),
               total = air + all.between(kBodySurface_hu + 1, 32767);
  if (air < 0.02 * total) {
    const auto classes = two_classes_hu(all, lowest, highest);
    if (!classes) throw InputError("{}: no vessel: all voxels have about {} HU", name, lowest);
    // In noise the halves of its histogram are no classes. What counts rises four standard deviations above
    // it, which in Gaussian noise one voxel in thirty thousand does by chance: too few to touch each other.
    // Where more than half lie at a value that the scan is cut off at, the median's deviation is none.
    constexpr double kRise = 4;
    const auto [median_hu, spread_hu] = median_and_spread_hu(all, lowest, highest);
    const double least_hu =
        std::max(0.5 * (classes->first + classes->second), median_hu + kRise * std::max(spread_hu, noise_hu));
    return Contrast{classes->first, classes->first + 2 * (least_hu - classes->first), noise_hu, false};
  }
  const Histogram insides(volume, static_cast<int>(std::max(60.0, 4 * noise_hu)));
  progress.advance();
  const double tissue_hu = insides.mode_hu(kTissueLow_hu, kTissueHigh_hu, 10);
  const auto peak_hu = contrast_peak_hu(insides, tissue_hu);
  if (!peak_hu) return std::nullopt;
  return Contrast{tissue_hu, *peak_hu, noise_hu};
}

Contrast measure_contrast(const Volume& volume, const std::string& name, Progress& progress) {
  const std::optional<Contrast> contrast = find_contrast(volume, name, progress);
  if (contrast) return *contrast;
  throw InputError(
      "{}: no vessel: no contrast agent shows between {} and {} HU; give the window of its CT numbers", name,
      kContrastLow_hu, kContrastHigh_hu);
}

}  // namespace xraycast
