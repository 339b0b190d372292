#pragma once

#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <vector>

namespace xraycast {

/// What a scan shows of a contrast above its background: Gaussian noise is added, and the sum may be cut off
/// at the scan's lowest and highest values, so that means lie nearer to the middle of the range. Where
/// nothing is cut off, means are the contrasts themselves.
class ScanResponse {
 public:
  /// The background is the median. Values are cut off at an end of their range that many voxels have.
  ScanResponse(const Volume& volume, double noise_hu);
  ScanResponse(double background_hu, double noise_hu, double lowest_hu, double highest_hu);

  double noise_hu() const { return noise_hu_; }
  double background_hu() const { return background_hu_; }

  /// Whether values are cut off, at either end.
  bool is_cut_off() const { return is_cut_off_; }

  /// From the background to the scan's highest value.
  double largest_hu() const { return largest_hu_; }

  /// The mean of what the scan shows of a contrast; beyond its range as far on as it goes there.
  double mean_hu(double contrast_hu) const;

  /// The contrast whose mean in the scan is `mean_hu`.
  double contrast_hu(double mean_hu) const;

 private:
  ScanResponse(const std::vector<std::int64_t>& counts, double noise_hu);
  ScanResponse(double background_hu, double noise_hu, double highest_hu, double cut_below_hu,
               double cut_above_hu);

  double noise_hu_, background_hu_, largest_hu_, first_hu_ = 0, step_hu_ = 1;
  bool is_cut_off_;
  std::vector<double> means_hu_;  ///< of contrasts from `first_hu_` on, `step_hu_` apart; ascending
};

}  // namespace xraycast
