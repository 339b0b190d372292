#pragma once

#include <vector>

namespace xraycast {

/// Robust statistics of many values: the median, and the standard deviation estimated from the median
/// absolute deviation. Of more than a million values about a million are looked at, evenly spaced.
struct RobustStatistics {
  double median = 0, standard_deviation = 0;
  double above(double deviations) const { return median + deviations * standard_deviation; }
};

RobustStatistics statistics_of(const std::vector<float>& values);

/// That of the values other than 0; zeros where there are none.
RobustStatistics statistics_of_nonzero(const std::vector<float>& values);

/// The value below which a fraction of values lies, of one or more.
double quantile(std::vector<double> values, double fraction);

}  // namespace xraycast
