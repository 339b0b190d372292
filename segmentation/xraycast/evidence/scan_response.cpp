#include "xraycast/evidence/scan_response.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

/// The mean of a normal distribution of mean `mean` and standard deviation 1 that is cut off at two values.
double mean_between(double mean, double lowest, double highest) {
  const auto density = [](double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); };
  const auto below = [](double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); };
  const double a = lowest - mean, b = highest - mean;
  return mean + density(a) - density(b) + a * below(a) + b * below(-b);
}

double median_hu(const Volume& volume) {
  std::vector<std::int64_t> counts(65536);
  for (const std::int16_t hu : volume.hu()) ++counts[static_cast<std::size_t>(hu + 32768)];
  std::size_t bin = 0;
  for (std::int64_t sum = counts[0]; 2 * sum < volume.geometry().voxel_count();) sum += counts[++bin];
  return static_cast<double>(bin) - 32768;
}

}  // namespace

ScanResponse::ScanResponse(const Volume& volume, double noise_hu)
    : ScanResponse(median_hu(volume), noise_hu, *std::ranges::min_element(volume.hu()),
                   *std::ranges::max_element(volume.hu())) {}

ScanResponse::ScanResponse(double background_hu, double noise_hu, double lowest_hu, double highest_hu)
    : noise_hu_(noise_hu), background_hu_(background_hu), largest_hu_(highest_hu - background_hu) {
  constexpr int kSteps = 2000;
  constexpr double kLeast = 1e-3;  // of the range; the response is almost sharp then
  const double spread_hu = std::max({noise_hu, kLeast * (highest_hu - lowest_hu), kLeast});
  first_hu_ = -2 * spread_hu;
  step_hu_ = (largest_hu_ + 4 * spread_hu) / kSteps;
  for (int i = 0; i <= kSteps; ++i)
    means_hu_.push_back(background_hu + spread_hu * mean_between((first_hu_ + i * step_hu_) / spread_hu,
                                                                 (lowest_hu - background_hu) / spread_hu,
                                                                 (highest_hu - background_hu) / spread_hu));
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
