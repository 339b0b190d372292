#include "xraycast/evidence/scan_response.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace xraycast {
namespace {

/// The mean of a normal distribution of mean `mean` and standard deviation 1 that is cut off at two values.
double mean_between(double mean, double lowest, double highest) {
  const auto density = [](double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); };
  const auto below = [](double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); };
  const double a = lowest - mean, b = highest - mean;
  return mean + density(a) - density(b) + a * below(a) + b * below(-b);
}

using Counts = std::vector<std::int64_t>;

Counts counts_of_levels(const Volume& volume) {
  Counts counts(65536);
  for (const std::int16_t hu : volume.hu()) ++counts[static_cast<std::size_t>(hu + 32768)];
  return counts;
}

double median_hu(const Counts& counts) {
  const std::int64_t all = std::reduce(counts.begin(), counts.end());
  std::size_t bin = 0;
  for (std::int64_t sum = counts[0]; 2 * sum < all;) sum += counts[++bin];
  return static_cast<double>(bin) - 32768;
}

/// Whether values are cut off at the first of the levels that occurs, going through them from one end: many
/// more voxels have it than the next ones. Else it is as far as noise has reached.
template <typename Iterator>
bool ends_at_once(Iterator first, Iterator last, double noise_hu) {
  constexpr std::int64_t kMany = 10, kTimes = 3;
  const Iterator end = std::find_if(first, last, [](std::int64_t count) { return count > 0; });
  const auto levels =
      std::min<std::ptrdiff_t>(std::max<std::ptrdiff_t>(std::lround(noise_hu), 1), last - end - 1);
  const std::int64_t beside = std::reduce(end + 1, end + 1 + levels);
  return *end >= kMany && levels * *end >= kTimes * beside;
}

double lowest_hu(const Counts& counts) {
  const auto at = std::ranges::find_if(counts, [](std::int64_t count) { return count > 0; });
  return static_cast<double>(at - counts.begin()) - 32768;
}

double highest_hu(const Counts& counts) {
  const auto at = std::find_if(counts.rbegin(), counts.rend(), [](std::int64_t count) { return count > 0; });
  return 32767 - static_cast<double>(at - counts.rbegin());
}

constexpr double kNever_hu = 1e9;  // beyond what a scan can hold

}  // namespace

ScanResponse::ScanResponse(const Volume& volume, double noise_hu)
    : ScanResponse(counts_of_levels(volume), noise_hu) {}

ScanResponse::ScanResponse(const Counts& counts, double noise_hu)
    : ScanResponse(median_hu(counts), noise_hu, highest_hu(counts),
                   ends_at_once(counts.begin(), counts.end(), noise_hu) ? lowest_hu(counts) : -kNever_hu,
                   ends_at_once(counts.rbegin(), counts.rend(), noise_hu) ? highest_hu(counts) : kNever_hu) {}

ScanResponse::ScanResponse(double background_hu, double noise_hu, double lowest_hu, double highest_hu)
    : ScanResponse(background_hu, noise_hu, highest_hu, lowest_hu, highest_hu) {}

ScanResponse::ScanResponse(double background_hu, double noise_hu, double highest_hu, double cut_below_hu,
                           double cut_above_hu)
    : noise_hu_(noise_hu),
      background_hu_(background_hu),
      largest_hu_(highest_hu - background_hu),
      is_cut_off_(cut_below_hu > -kNever_hu || cut_above_hu < kNever_hu) {
  constexpr int kSteps = 2000;
  constexpr double kLeast = 1e-3;  // of the largest contrast; the response is almost sharp then
  const double spread_hu = std::max({noise_hu, kLeast * largest_hu_, kLeast});
  first_hu_ = -2 * spread_hu;
  step_hu_ = (largest_hu_ + 4 * spread_hu) / kSteps;
  for (int i = 0; i <= kSteps; ++i)
    means_hu_.push_back(background_hu + spread_hu * mean_between((first_hu_ + i * step_hu_) / spread_hu,
                                                                 (cut_below_hu - background_hu) / spread_hu,
                                                                 (cut_above_hu - background_hu) / spread_hu));
}

double ScanResponse::mean_hu(double contrast_hu) const {
  const double place = (contrast_hu - first_hu_) / step_hu_, last = static_cast<double>(means_hu_.size() - 2);
  const double i = std::clamp(std::floor(place), 0.0, last);
  const auto at = static_cast<std::size_t>(i);
  return std::lerp(means_hu_[at], means_hu_[at + 1], place - i);
}

double ScanResponse::contrast_hu(double mean_hu) const {
  const auto above = std::ranges::upper_bound(means_hu_, mean_hu);
  if (above == means_hu_.begin()) return first_hu_;
  const auto i = static_cast<std::size_t>(above - means_hu_.begin()) - 1;
  const double at = static_cast<double>(i);
  if (i + 1 == means_hu_.size()) return first_hu_ + at * step_hu_;
  const double rise = means_hu_[i + 1] - means_hu_[i];
  return first_hu_ + (at + (rise > 0 ? (mean_hu - means_hu_[i]) / rise : 0)) * step_hu_;
}

}  // namespace xraycast
