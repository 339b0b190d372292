#include "xraycast/fluoroscope/blur.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr int kFrequencies = 128;

double cycles_of(int frequency) { return 0.5 * (frequency + 0.5) / kFrequencies; }

Eigen::VectorXd sampled(const ByFrequency& function) {
  Eigen::VectorXd values(kFrequencies);
  for (int i = 0; i < kFrequencies; ++i) values(i) = function(cycles_of(i));
  return values;
}

/// The transfer is 1 at frequency 0 whatever the weights, since the middle one makes up for the others. C. L.
/// Lawson's iteration: least squares in which frequencies count by their errors so far, which makes the
/// largest error in units of the tolerance small.
SymmetricTaps fitted_taps(const Eigen::VectorXd& transfer, const Eigen::VectorXd& tolerance, int neighbours) {
  Eigen::MatrixXd waves(kFrequencies, neighbours);
  for (int i = 0; i < kFrequencies; ++i)
    for (int k = 0; k < neighbours; ++k)
      waves(i, k) = 2 * (std::cos(2 * std::numbers::pi * (k + 1) * cycles_of(i)) - 1);
  const Eigen::VectorXd wanted = transfer.array() - 1;
  Eigen::VectorXd counts = tolerance.array().square().inverse(), weights;
  constexpr int kIterations = 30;
  constexpr double kLeast = 1e-9;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Eigen::MatrixXd counted = counts.asDiagonal() * waves;
    weights = (waves.transpose() * counted).ldlt().solve(counted.transpose() * wanted);
    counts.array() *= (waves * weights - wanted).array().abs() / tolerance.array() + kLeast;
    counts *= kFrequencies / counts.sum();
  }
  SymmetricTaps taps{static_cast<float>(1 - 2 * weights.sum())};
  for (int k = 0; k < neighbours; ++k) taps.push_back(static_cast<float>(weights(k)));
  return taps;
}

/// The weights of a wide bell, scaled to add up to 1.
SymmetricTaps sampled_taps(double spread, const std::function<double(int)>& bell) {
  constexpr double kSpreads = 4;
  std::vector<double> weights;
  for (int k = 0; k <= kSpreads * spread; ++k) weights.push_back(bell(k));
  double sum = -weights.front();
  for (const double weight : weights) sum += 2 * weight;
  SymmetricTaps taps;
  for (const double weight : weights) taps.push_back(static_cast<float>(weight / sum));
  return taps;
}

double gaussian_transfer(double cycles, double spread) {
  return std::exp(-2 * std::pow(std::numbers::pi * spread * cycles, 2));
}

// Above this spread in pixels, what samples alias is below 1e-3.
constexpr double kWide = 1.3;

}  // namespace

double transfer_of(const SymmetricTaps& taps, double cycles) {
  double sum = taps.front();
  for (std::size_t k = 1; k < taps.size(); ++k)
    sum += 2 * taps[k] * std::cos(2 * std::numbers::pi * static_cast<double>(k) * cycles);
  return sum;
}

SymmetricTaps taps_for(const ByFrequency& transfer, const ByFrequency& tolerance) {
  constexpr int kMost = 24;
  const Eigen::VectorXd wanted = sampled(transfer), within = sampled(tolerance);
  for (int neighbours = 1;; ++neighbours) {
    SymmetricTaps taps = fitted_taps(wanted, within, neighbours);
    bool is_close = true;
    for (int i = 0; i < kFrequencies; ++i)
      is_close = is_close && std::abs(transfer_of(taps, cycles_of(i)) - wanted(i)) < within(i);
    if (is_close || neighbours == kMost) return taps;
  }
}

SymmetricTaps gaussian_taps(double spread, const ByFrequency& tolerance) {
  if (spread > kWide)
    return sampled_taps(spread, [&](int k) { return std::exp(-0.5 * std::pow(k / spread, 2)); });
  return taps_for([&](double cycles) { return gaussian_transfer(cycles, spread); }, tolerance);
}

SymmetricTaps averaged_gaussian_taps(double spread, const ByFrequency& tolerance) {
  const auto below = [&](double at) { return 0.5 * std::erfc(-at / spread / std::numbers::sqrt2); };
  if (spread > kWide) return sampled_taps(spread, [&](int k) { return below(k + 0.5) - below(k - 0.5); });
  return taps_for(
      [&](double cycles) {
        const double turn = std::numbers::pi * cycles;
        return std::sin(turn) / turn * gaussian_transfer(cycles, spread);
      },
      tolerance);
}

}  // namespace xraycast
