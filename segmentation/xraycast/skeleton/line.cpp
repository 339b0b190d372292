#include "xraycast/skeleton/line.hpp"

#include "xraycast/mask/skeleton_graph.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

template <typename T>
std::vector<T> smoothed_values(const std::vector<T>& values, double sigma) {
  std::vector<T> result = values;
  const auto count = static_cast<int>(values.size());
  for (int i = 1; i + 1 < count; ++i) {
    const int reach = std::min({i, count - 1 - i, static_cast<int>(std::ceil(3 * sigma))});
    T sum{};
    double weights = 0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
      const int at = i + k;
      sum += weight * values[static_cast<std::size_t>(at)];
      weights += weight;
    }
    result[static_cast<std::size_t>(i)] = sum / weights;
  }
  return result;
}

}  // namespace

Line resampled(const Line& line, double step_mm) {
  const double total_mm = length_mm(line);
  const int steps = std::max(1, static_cast<int>(std::ceil(total_mm / step_mm)));
  Line result{line.front()};
  double passed_mm = 0;
  std::size_t i = 1;
  for (int k = 1; k < steps; ++k) {
    const double target_mm = total_mm * k / steps;
    while (i + 1 < line.size() && passed_mm + glm::distance(line[i - 1], line[i]) < target_mm) {
      passed_mm += glm::distance(line[i - 1], line[i]);
      ++i;
    }
    const double piece_mm = glm::distance(line[i - 1], line[i]);
    result.push_back(glm::mix(line[i - 1], line[i], piece_mm > 0 ? (target_mm - passed_mm) / piece_mm : 0.0));
  }
  result.push_back(line.back());
  return result;
}

std::vector<double> smoothed(const std::vector<double>& values, double sigma) {
  return smoothed_values(values, sigma);
}

Line smoothed(const Line& line, double sigma) { return smoothed_values(line, sigma); }

glm::dvec3 tangent_at(const Line& line, std::size_t i, std::size_t reach) {
  const std::size_t before = i >= reach ? i - reach : 0, after = std::min(i + reach, line.size() - 1);
  const glm::dvec3 along = line[after] - line[before];
  const double length = glm::length(along);
  return length > 0 ? along / length : glm::dvec3(0, 0, 1);
}

Line towards_middle(const Line& line, std::size_t first, std::size_t last, const Lumen& lumen) {
  constexpr std::size_t kTangentReach = 6;
  const double most_mm = 0.5 * lumen.voxel_mm();
  Line moved = line;
  for (std::size_t i = first; i < last; ++i) {
    const glm::dvec3 shift = cross_section(lumen, line[i], tangent_at(line, i, kTangentReach)).to_middle_mm;
    const double length = glm::length(shift);
    moved[i] += length > most_mm ? shift * (most_mm / length) : shift;
  }
  return moved;
}

}  // namespace xraycast
