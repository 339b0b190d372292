#include "xraycast/reports/scale_ticks.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// 1, 2 or 5 times a power of ten: 0 is 1, 1 is 2, 2 is 5, 3 is 10, and -1 is 0.5.
double round_number(int index) {
  constexpr double kDigits[] = {1, 2, 5};
  const int decade = static_cast<int>(std::floor(index / 3.0));
  return kDigits[index - 3 * decade] * std::pow(10, decade);
}

/// Of the smallest one that is at least so much.
int index_of_round_number(double least) {
  int index = 3 * static_cast<int>(std::floor(std::log10(least)));
  while (round_number(index) < least) ++index;
  return index;
}

std::vector<double> multiples(double step, double low, double high) {
  std::vector<double> values;
  for (double n = std::ceil(low / step); n * step <= high; ++n) values.push_back(n * step + 0.0);  // no -0
  return values;
}

}  // namespace

std::vector<double> scale_ticks(double low, double high, double least_step) {
  if (!(high > low)) return {low};
  int index = index_of_round_number(least_step);
  std::vector<double> ticks = multiples(round_number(index), low, high);
  if (ticks.size() >= 2) return ticks;
  index = std::min(index, index_of_round_number(high - low));
  while (ticks.size() < 2) ticks = multiples(round_number(--index), low, high);
  return {ticks.front(), ticks.back()};
}

}  // namespace xraycast
