#include "xraycast/fluoroscope/scatter.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr double kScatterSpread_mm = 60;
// 3 in the middle of 30 x 30 cm, where the Gaussian lies within the field but for 2.5 %.
constexpr float kRatioPer_g_cm2 = 0.154f;

}  // namespace

Scatter::Scatter(int columns, int rows, double cell_mm) : columns_(columns), rows_(rows) {
  const double cells = kScatterSpread_mm / cell_mm;
  double sum = 0;
  std::vector<double> weights;
  for (int k = 0; k < std::max(columns, rows); ++k) {
    weights.push_back(std::exp(-0.5 * (k / cells) * (k / cells)));
    sum += (k > 0 ? 2 : 1) * weights.back();
  }
  // Cells beyond the picture count for the normalisation too.
  sum = std::max(sum, cells * 2.50662827463);
  for (const double weight : weights) weights_.push_back(static_cast<float>(weight / sum));
  const std::size_t count = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  for (auto* plane : {&sources_, &spread_, &result_}) plane->resize(count);
}

std::span<const float> Scatter::from(std::span<const float> primary, std::span<const float> g_cm2) {
  for (std::size_t i = 0; i < sources_.size(); ++i) sources_[i] = kRatioPer_g_cm2 * primary[i] * g_cm2[i];
  std::ranges::fill(spread_, 0.0f);
  std::ranges::fill(result_, 0.0f);
  for (int row = 0; row < rows_; ++row)
    for (int from = 0; from < columns_; ++from)
      for (int to = 0; to < columns_; ++to)
        spread_[row * columns_ + to] += weights_[std::abs(to - from)] * sources_[row * columns_ + from];
  for (int to = 0; to < rows_; ++to)
    for (int from = 0; from < rows_; ++from)
      for (int column = 0; column < columns_; ++column)
        result_[to * columns_ + column] += weights_[std::abs(to - from)] * spread_[from * columns_ + column];
  return result_;
}

}  // namespace xraycast
