#include "xraycast/requests/comparison.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace xraycast {
namespace {

constexpr int kReach = 5;  // of an SSIM window, on both sides of its middle

/// Weighted sums over windows, by rows and then by columns; windows that extend beyond the picture repeat its
/// border.
std::vector<double> windowed(const std::vector<double>& image, int width, int height) {
  std::array<double, 2 * kReach + 1> weights{};
  double sum = 0;
  for (int i = -kReach; i <= kReach; ++i) sum += weights[i + kReach] = std::exp(-i * i / (2 * 1.5 * 1.5));
  for (double& weight : weights) weight /= sum;
  std::vector<double> across(image.size()), both(image.size());
  parallel_for(height, [&](std::int64_t y) {
    for (int x = 0; x < width; ++x)
      for (int i = -kReach; i <= kReach; ++i)
        across[y * width + x] += weights[i + kReach] * image[y * width + std::clamp(x + i, 0, width - 1)];
  });
  parallel_for(height, [&](std::int64_t y) {
    for (int i = -kReach; i <= kReach; ++i) {
      const std::int64_t from = std::clamp<std::int64_t>(y + i, 0, height - 1) * width;
      for (int x = 0; x < width; ++x) both[y * width + x] += weights[i + kReach] * across[from + x];
    }
  });
  return both;
}

double ssim(const std::vector<double>& a, const std::vector<double>& b, std::span<const std::uint8_t> counts,
            int width, int height) {
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  const auto product = [](const std::vector<double>& p, const std::vector<double>& q) {
    std::vector<double> result(p.size());
    std::ranges::transform(p, q, result.begin(), std::multiplies());
    return result;
  };
  const auto mean_a = windowed(a, width, height), mean_b = windowed(b, width, height);
  const auto aa = windowed(product(a, a), width, height), bb = windowed(product(b, b), width, height),
             ab = windowed(product(a, b), width, height);
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!counts[i]) continue;
    const double ma = mean_a[i], mb = mean_b[i];
    sum += (2 * ma * mb + kC1) * (2 * (ab[i] - ma * mb) + kC2) /
           ((ma * ma + mb * mb + kC1) * (aa[i] - ma * ma + bb[i] - mb * mb + kC2));
    ++count;
  }
  return count > 0 ? sum / count : 1;
}

std::vector<double> displayed(std::span<const float> tau) {
  constexpr double kScale = 2.2;
  std::vector<double> grey(tau.size());
  std::ranges::transform(tau, grey.begin(), [](float t) { return 1 - std::exp(-t / kScale); });
  return grey;
}

}  // namespace

ImageSimilarity compare(std::span<const float> tau, std::span<const float> drr,
                        std::span<const std::uint8_t> counts, int width, int height) {
  double transmission = 0, depth = 0, count = 0, deepest = 0;
  for (std::size_t i = 0; i < tau.size(); ++i) {
    if (!counts[i]) continue;
    const double a = tau[i], b = drr[i], difference = std::exp(-a) - std::exp(-b);
    transmission += difference * difference;
    depth += (a - b) * (a - b);
    deepest = std::max(deepest, b);
    ++count;
  }
  if (count == 0) return {0, 1, 0, 0};
  constexpr double kLeast = 1e-12;  // equal pictures have 120 dB
  return {-10 * std::log10(std::max(kLeast, transmission / count)),
          ssim(displayed(tau), displayed(drr), counts, width, height),
          deepest > 0 ? std::sqrt(depth / count) / deepest : 0, deepest};
}

}  // namespace xraycast
