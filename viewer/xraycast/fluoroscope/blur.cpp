#include "xraycast/fluoroscope/blur.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr int kFrequencies = 128;

double cycles_of(int frequency) { return 0.5 * (frequency + 0.5) / kFrequencies; }

/// The transfer is 1 at frequency 0 whatever the weights, since the middle one makes up for the others. C. L.
/// Lawson's iteration: least squares in which frequencies count by their errors so far, which makes the
/// largest error small.
SymmetricTaps fitted_taps(const std::function<double(double)>& transfer, int neighbours) {
  Eigen::MatrixXd waves(kFrequencies, neighbours);
  Eigen::VectorXd wanted(kFrequencies), counts = Eigen::VectorXd::Constant(kFrequencies, 1);
  for (int i = 0; i < kFrequencies; ++i) {
    wanted(i) = transfer(cycles_of(i)) - 1;
    for (int k = 0; k < neighbours; ++k)
      waves(i, k) = 2 * (std::cos(2 * std::numbers::pi * (k + 1) * cycles_of(i)) - 1);
  }
  Eigen::VectorXd weights;
  constexpr int kIterations = 30;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Eigen::MatrixXd counted = counts.asDiagonal() * waves;
    weights = (waves.transpose() * counted).ldlt().solve(counted.transpose() * wanted);
    counts = counts.cwiseProduct((waves * weights - wanted).cwiseAbs() +
                                 Eigen::VectorXd::Constant(kFrequencies, 1e-9));
    counts *= kFrequencies / counts.sum();
  }
  SymmetricTaps taps{static_cast<float>(1 - 2 * weights.sum())};
  for (int k = 0; k < neighbours; ++k) taps.push_back(static_cast<float>(weights(k)));
  return taps;
}

}  // namespace

double transfer_of(const SymmetricTaps& taps, double cycles) {
  double sum = taps.front();
  for (std::size_t k = 1; k < taps.size(); ++k)
    sum += 2 * taps[k] * std::cos(2 * std::numbers::pi * static_cast<double>(k) * cycles);
  return sum;
}

SymmetricTaps taps_for(const std::function<double(double)>& transfer) {
  constexpr int kMost = 24;
  constexpr double kClose = 0.006;
  for (int neighbours = 1;; ++neighbours) {
    SymmetricTaps taps = fitted_taps(transfer, neighbours);
    double worst = 0;
    for (int i = 0; i < kFrequencies; ++i)
      worst = std::max(worst, std::abs(transfer_of(taps, cycles_of(i)) - transfer(cycles_of(i))));
    if (worst < kClose || neighbours == kMost) return taps;
  }
}

}  // namespace xraycast
