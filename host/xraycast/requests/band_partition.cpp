#include "xraycast/requests/band_partition.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace xraycast {
namespace {

/// Of the area within one outline: what one more band has to save.
constexpr double kLeastGain = 0.03;

/// The area within the common outline of every run of rows, times their number: [first][last].
std::vector<std::vector<double>> areas_of_runs(std::span<const float> reaches_mm, std::size_t width) {
  const std::size_t rows = reaches_mm.size() / width;
  std::vector<std::vector<double>> areas(rows, std::vector<double>(rows, 0));
  for (std::size_t first = 0; first < rows; ++first) {
    std::vector<float> widest_mm(width, 0);
    for (std::size_t last = first; last < rows; ++last) {
      double sum_mm2 = 0;
      for (std::size_t i = 0; i < width; ++i) {
        widest_mm[i] = std::max(widest_mm[i], reaches_mm[last * width + i]);
        sum_mm2 += double{widest_mm[i]} * widest_mm[i];
      }
      areas[first][last] = sum_mm2 * static_cast<double>(last - first + 1);
    }
  }
  return areas;
}

}  // namespace

std::vector<int> partition_into_bands(std::span<const float> reaches_mm, int width, int most) {
  const auto areas = areas_of_runs(reaches_mm, static_cast<std::size_t>(width));
  const std::size_t rows = areas.size();
  // The least area of rows 0 to `last` in so many bands, and the first row of the last of these.
  struct Best {
    double area = std::numeric_limits<double>::infinity();
    std::size_t first = 0;
  };
  std::vector<std::vector<Best>> best{std::vector<Best>(rows)};
  for (std::size_t last = 0; last < rows; ++last) best[0][last] = {areas[0][last], 0};
  while (static_cast<int>(best.size()) < most) {
    std::vector<Best> more(rows);
    for (std::size_t last = 1; last < rows; ++last)
      for (std::size_t first = 1; first <= last; ++first)
        if (const double area = best.back()[first - 1].area + areas[first][last]; area < more[last].area)
          more[last] = {area, first};
    best.push_back(std::move(more));
  }
  // A waist between two wide parts takes two bands more at once.
  std::size_t bands = 1;
  const auto price_of = [&](std::size_t count) {
    return best[count - 1].back().area + kLeastGain * best[0].back().area * static_cast<double>(count);
  };
  for (std::size_t count = 2; count <= best.size(); ++count)
    if (price_of(count) < price_of(bands)) bands = count;

  std::vector<int> first_rows;
  for (std::size_t last = rows - 1; bands-- > 0;) {
    const std::size_t first = best[bands][last].first;
    first_rows.insert(first_rows.begin(), static_cast<int>(first));
    last = first - 1;
  }
  return first_rows;
}

}  // namespace xraycast
