#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace xraycast {

/// A smooth curve through points that overshoots none of them (Fritsch and Carlson, SIAM J. Numer. Anal. 17,
/// 1980), constant beyond its ends.
class MonotoneProfile {
 public:
  /// Two points or more, x ascending.
  explicit MonotoneProfile(std::vector<std::pair<double, double>> points) : points_(std::move(points)) {
    const std::size_t last = points_.size() - 1;
    slopes_.assign(points_.size(), 0);
    for (std::size_t i = 1; i < last; ++i) {
      const double before = rise(i - 1), after = rise(i);
      // The harmonic mean, 0 at a peak, keeps every piece monotone.
      if (before * after > 0) slopes_[i] = 2 * before * after / (before + after);
    }
  }

  double operator()(double x) const {
    if (x <= points_.front().first) return points_.front().second;
    if (x >= points_.back().first) return points_.back().second;
    const auto above = std::ranges::upper_bound(points_, x, {}, &std::pair<double, double>::first);
    const auto i = static_cast<std::size_t>(above - points_.begin()) - 1;
    const double h = points_[i + 1].first - points_[i].first, t = (x - points_[i].first) / h;
    return (1 + 2 * t) * (1 - t) * (1 - t) * points_[i].second + t * (1 - t) * (1 - t) * h * slopes_[i] +
           t * t * (3 - 2 * t) * points_[i + 1].second + t * t * (t - 1) * h * slopes_[i + 1];
  }

 private:
  double rise(std::size_t i) const {
    return (points_[i + 1].second - points_[i].second) / (points_[i + 1].first - points_[i].first);
  }

  std::vector<std::pair<double, double>> points_;
  std::vector<double> slopes_;
};

}  // namespace xraycast
