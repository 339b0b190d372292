#include "xraycast/evidence/robust_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace xraycast {
namespace {

template <typename Counts>
RobustStatistics statistics_where(const std::vector<float>& values, const Counts& counts) {
  constexpr std::size_t kEnough = 1'000'000;
  const std::size_t step = std::max<std::size_t>(1, values.size() / kEnough);
  std::vector<float> some;
  for (std::size_t i = 0; i < values.size(); i += step)
    if (counts(values[i])) some.push_back(values[i]);
  if (some.empty()) return {};
  const auto middle = some.begin() + static_cast<std::ptrdiff_t>(some.size() / 2);
  std::ranges::nth_element(some, middle);
  const float median = *middle;
  for (float& v : some) v = std::abs(v - median);
  std::ranges::nth_element(some, middle);
  return {static_cast<double>(median), 1.4826 * static_cast<double>(*middle)};
}

}  // namespace

RobustStatistics statistics_of(const std::vector<float>& values) {
  return statistics_where(values, [](float) { return true; });
}

RobustStatistics statistics_of_nonzero(const std::vector<float>& values) {
  return statistics_where(values, [](float v) { return v != 0; });
}

double quantile(std::vector<double> values, double fraction) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

}  // namespace xraycast
