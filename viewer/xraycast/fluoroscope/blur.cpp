#include "xraycast/fluoroscope/blur.hpp"

#include "xraycast/base/error.hpp"

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

/// The weights of a wide Gaussian, averaged over pixels, to four spreads, scaled to add up to 1.
SymmetricTaps sampled_taps(double spread) {
  const auto below = [&](double at) { return 0.5 * std::erfc(-at / spread / std::numbers::sqrt2); };
  constexpr double kSpreads = 4;
  std::vector<double> weights;
  for (int k = 0; k <= kSpreads * spread; ++k) weights.push_back(below(k + 0.5) - below(k - 0.5));
  double sum = -weights.front();
  for (const double weight : weights) sum += 2 * weight;
  SymmetricTaps taps;
  for (const double weight : weights) taps.push_back(static_cast<float>(weight / sum));
  return taps;
}

double transfer_of(const SymmetricTaps& taps, double cycles) {
  double sum = taps.front();
  for (std::size_t k = 1; k < taps.size(); ++k)
    sum += 2 * taps[k] * std::cos(2 * std::numbers::pi * static_cast<double>(k) * cycles);
  return sum;
}

// Above this spread in pixels, what samples alias is below 1e-3.
constexpr double kWide = 1.3;

/// A wider scintillator leaves so little at the frequencies where the split differs that it is taken as this
/// one, whose aperture does not ring.
ScintillatorBlur split_blur(const ScintillatorBlur& blur) {
  constexpr double kWidest = 0.6;
  const double closer = blur.narrow_mm > kWidest ? kWidest / blur.narrow_mm : 1;
  return {closer * blur.narrow_mm, closer * blur.wide_mm, blur.wide_share};
}

}  // namespace

double averaged_gaussian_transfer(double cycles, double spread) {
  const double turn = std::numbers::pi * cycles;
  return (turn == 0 ? 1 : std::sin(turn) / turn) * gaussian_transfer(cycles, spread);
}

double aliased_gaussian_transfer(double cycles, double spread) {
  constexpr double kNone = 0.003;
  constexpr int kMost = 400;  // until even that spread leaves nothing
  if (spread < kNone) return 1;
  double power = 0;
  for (int k = -kMost; k <= kMost; ++k) power += std::pow(averaged_gaussian_transfer(cycles + k, spread), 2);
  return std::sqrt(power);
}

SymmetricTaps taps_for(const ByFrequency& transfer, const ByFrequency& tolerance) {
  constexpr int kMost = 24;
  const Eigen::VectorXd wanted = sampled(transfer), within = sampled(tolerance);
  for (int neighbours = 1;; ++neighbours) {
    SymmetricTaps taps = fitted_taps(wanted, within, neighbours);
    bool is_close = true;
    for (int i = 0; i < kFrequencies; ++i)
      is_close = is_close && std::abs(transfer_of(taps, cycles_of(i)) - wanted(i)) < within(i);
    if (is_close) return taps;
    if (neighbours == kMost) throw Error("a blur filter needs more than {} neighbours; report this", kMost);
  }
}

SymmetricTaps light_taps(double spread, const ByFrequency& tolerance) {
  if (spread > kWide) return sampled_taps(spread);
  return taps_for([&](double cycles) { return aliased_gaussian_transfer(cycles, spread); }, tolerance);
}

double light_transfer(double cycles, const ScintillatorBlur& blur) {
  return (1 - blur.wide_share) * aliased_gaussian_transfer(cycles, blur.narrow_mm) +
         blur.wide_share * aliased_gaussian_transfer(cycles, blur.wide_mm);
}

ScintillatorBlur in_pixels(const ScintillatorBlur& blur, double pixel_mm) {
  return {blur.narrow_mm / pixel_mm, blur.wide_mm / pixel_mm, blur.wide_share};
}

SymmetricTaps primary_taps(double focal_spread, const ScintillatorBlur& blur, const ByFrequency& tolerance) {
  if (focal_spread > kWide) return sampled_taps(focal_spread);
  const ScintillatorBlur split = split_blur(blur);
  return taps_for(
      [&](double cycles) {
        return averaged_gaussian_transfer(cycles, focal_spread) * split.mtf(cycles) /
               light_transfer(cycles, split);
      },
      tolerance);
}

// ---- edges ----------------------------------------------------------------------------------------------

namespace {

/// The integral of the cumulative normal distribution of a spread.
double integrated_step(double at, double spread) {
  if (!(spread > 0)) return std::max(0.0, at);
  const double z = at / spread;
  return at * 0.5 * std::erfc(-z / std::numbers::sqrt2) +
         spread * std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
}

}  // namespace

EdgeProfile::EdgeProfile(double focal_spread, const ScintillatorBlur& blur, const SymmetricTaps& taps) {
  constexpr double kSpreads = 8;
  const int neighbours = static_cast<int>(taps.size()) - 1;
  const double narrow = std::hypot(focal_spread, blur.narrow_mm),
               wide = std::hypot(focal_spread, blur.wide_mm);
  reach_ = std::ceil(0.5 + kSpreads * std::max(narrow, wide)) + neighbours;
  const auto averaged = [](double inside, double spread) {
    return integrated_step(inside + 0.5, spread) - integrated_step(inside - 0.5, spread);
  };
  const auto seen = [&](double inside) {
    return (1 - blur.wide_share) * averaged(inside, narrow) + blur.wide_share * averaged(inside, wide);
  };
  const int steps = static_cast<int>(2 * reach_ * kPerPixel);
  for (int step = 0; step <= steps; ++step) {
    const double inside = 1.0 * step / kPerPixel - reach_;
    double sum = taps.front() * seen(inside);
    for (int k = 1; k <= neighbours; ++k)
      sum += taps[static_cast<std::size_t>(k)] * (seen(inside - k) + seen(inside + k));
    shares_.push_back(static_cast<float>(sum));
  }
}

EdgeProfile EdgeProfile::behind_scintillator(double focal_spread, const ScintillatorBlur& blur) {
  const ScintillatorBlur split = split_blur(blur);
  constexpr double kWithin = 0.003;
  const SymmetricTaps sharpening = taps_for(
      [&](double cycles) { return 1 / light_transfer(cycles, split); },
      [&](double cycles) { return kWithin / (averaged_gaussian_transfer(cycles, 0) * split.mtf(cycles)); });
  return {focal_spread, split, sharpening};
}

double EdgeProfile::at(double inside) const {
  if (inside >= reach_) return 1;
  if (inside <= -reach_) return 0;
  const double at = (inside + reach_) * kPerPixel;
  const auto step = static_cast<std::size_t>(at);
  return std::lerp(double{shares_[step]}, double{shares_[std::min(step + 1, shares_.size() - 1)]},
                   at - static_cast<double>(step));
}

}  // namespace xraycast
