#include "xraycast/fluoroscope/scatter.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr double kScatterSpread_mm = 60;
constexpr float kRatioPer_g_cm2 = 0.154f;

/// Weights from each of a line's cells to each: of a Gaussian whose sum is 1 over an endless line, and at
/// both ends of what lies beyond.
std::vector<float> line_weights(int count, double spread, double sum, int beyond) {
  const auto weight = [&](int distance) {
    return std::exp(-0.5 * (distance / spread) * (distance / spread)) / sum;
  };
  std::vector<float> weights;
  for (int from = 0; from < count; ++from)
    for (int to = 0; to < count; ++to) {
      double all = weight(to - from);
      for (int k = 1; k <= beyond && from == 0; ++k) all += weight(to + k);
      for (int k = 1; k <= beyond && from == count - 1; ++k) all += weight(count - 1 + k - to);
      weights.push_back(static_cast<float>(all));
    }
  return weights;
}

}  // namespace

Scatter::Scatter(int columns, int rows, double cell_mm, Beyond beyond) : columns_(columns), rows_(rows) {
  const double spread = kScatterSpread_mm / cell_mm;
  // The sum of so many cells that the rest does not count, however large they are.
  double sum = 1;
  constexpr int kSpreads = 6;
  for (int k = 1; k <= kSpreads * spread; ++k) sum += 2 * std::exp(-0.5 * (k / spread) * (k / spread));
  const int most = static_cast<int>(kSpreads * spread);
  across_ = line_weights(columns, spread, sum, std::min(beyond.columns, most));
  down_ = line_weights(rows, spread, sum, std::min(beyond.rows, most));
  const std::size_t count = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  for (auto* plane : {&sources_, &spread_, &result_}) plane->resize(count);
}

std::span<const float> Scatter::from(std::span<const float> primary, std::span<const float> g_cm2) {
  for (std::size_t i = 0; i < sources_.size(); ++i) sources_[i] = kRatioPer_g_cm2 * primary[i] * g_cm2[i];
  std::fill(spread_.begin(), spread_.end(), 0.0f);
  std::fill(result_.begin(), result_.end(), 0.0f);
  for (int row = 0; row < rows_; ++row)
    for (int from = 0; from < columns_; ++from)
      for (int to = 0; to < columns_; ++to)
        spread_[row * columns_ + to] += across_[from * columns_ + to] * sources_[row * columns_ + from];
  for (int to = 0; to < rows_; ++to)
    for (int from = 0; from < rows_; ++from)
      for (int column = 0; column < columns_; ++column)
        result_[to * columns_ + column] += down_[from * rows_ + to] * spread_[from * columns_ + column];
  return result_;
}

}  // namespace xraycast
