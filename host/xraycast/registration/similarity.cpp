#include "xraycast/registration/similarity.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/registration/edge_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace xraycast::similarity {
namespace {

std::size_t count_of(const Pair& pair) {
  if (pair.width < 1 || pair.height < 1)
    throw InputError("pictures of {} x {} pixels cannot be compared", pair.width, pair.height);
  const std::size_t count = static_cast<std::size_t>(pair.width) * static_cast<std::size_t>(pair.height);
  if (pair.fixed.size() != count || pair.moving.size() != count ||
      (!pair.mask.empty() && pair.mask.size() != count))
    throw InputError("two pictures and their mask must have one size, {} x {} pixels", pair.width,
                     pair.height);
  return count;
}

struct Moments {
  double count = 0, fixed_mean = 0, moving_mean = 0, fixed_norm = 0, moving_norm = 0, product = 0;
  bool has_contrast() const {
    // Below, what is left of equal values is rounding.
    constexpr double kRounding = 1e-6;
    return count > 1 && fixed_norm > kRounding * std::abs(fixed_mean) * std::sqrt(count) && fixed_norm > 0 &&
           moving_norm > kRounding * std::abs(moving_mean) * std::sqrt(count) && moving_norm > 0;
  }
};

template <typename Visit>
void for_each_counted(std::span<const std::uint8_t> mask, std::size_t count, const Visit& visit) {
  for (std::size_t i = 0; i < count; ++i)
    if (mask.empty() || mask[i] != 0) visit(i);
}

Moments moments_of(std::span<const float> fixed, std::span<const float> moving,
                   std::span<const std::uint8_t> mask) {
  Moments m;
  for_each_counted(mask, fixed.size(), [&](std::size_t i) {
    m.count += 1;
    m.fixed_mean += fixed[i];
    m.moving_mean += moving[i];
  });
  if (m.count == 0) return m;
  m.fixed_mean /= m.count;
  m.moving_mean /= m.count;
  double fixed_2 = 0, moving_2 = 0;
  for_each_counted(mask, fixed.size(), [&](std::size_t i) {
    const double f = fixed[i] - m.fixed_mean, g = moving[i] - m.moving_mean;
    fixed_2 += f * f;
    moving_2 += g * g;
    m.product += f * g;
  });
  m.fixed_norm = std::sqrt(fixed_2);
  m.moving_norm = std::sqrt(moving_2);
  return m;
}

double correlation(std::span<const float> fixed, std::span<const float> moving,
                   std::span<const std::uint8_t> mask, std::vector<float>* slope) {
  const Moments m = moments_of(fixed, moving, mask);
  if (slope) slope->assign(fixed.size(), 0);
  if (!m.has_contrast()) return 0;
  const double value = m.product / (m.fixed_norm * m.moving_norm);
  if (slope)
    for_each_counted(mask, fixed.size(), [&](std::size_t i) {
      (*slope)[i] = static_cast<float>(
          ((fixed[i] - m.fixed_mean) / m.fixed_norm - value * (moving[i] - m.moving_mean) / m.moving_norm) /
          m.moving_norm);
    });
  return value;
}

// ---- mutual information

constexpr int kBins = 32, kPadding = 2;  ///< of the moving picture's, for the B-spline's support

struct Greys {
  double lowest = 0, bin = 1;
};

Greys greys_of(std::span<const float> picture, std::span<const std::uint8_t> mask, int bins) {
  double lowest = HUGE_VAL, highest = -HUGE_VAL;
  for_each_counted(mask, picture.size(), [&](std::size_t i) {
    lowest = std::min<double>(lowest, picture[i]);
    highest = std::max<double>(highest, picture[i]);
  });
  return {lowest, (highest - lowest) / bins};
}

double cubic(double x) {
  const double a = std::abs(x);
  if (a < 1) return 2.0 / 3 - a * a + a * a * a / 2;
  return a < 2 ? (2 - a) * (2 - a) * (2 - a) / 6 : 0;
}

double cubic_slope(double x) {
  const double a = std::abs(x), sign = x < 0 ? -1 : 1;
  if (a < 1) return sign * (-2 * a + 1.5 * a * a);
  return a < 2 ? -sign * (2 - a) * (2 - a) / 2 : 0;
}

/// Where a pixel falls: the fixed picture's bin, and the moving one's place among its bins.
struct Place {
  int fixed;
  double moving;
  int first() const { return static_cast<int>(std::floor(moving)) - 1; }  ///< of four bins
};

using Joint = std::array<std::array<double, kBins>, kBins>;  ///< [fixed][moving]

/// The log of p(f, m) / p(m), by which information changes with the histogram.
Joint log_ratios(const Joint& joint, double& information) {
  std::array<double, kBins> fixed{}, moving{};
  for (int f = 0; f < kBins; ++f)
    for (int m = 0; m < kBins; ++m) {
      fixed[f] += joint[f][m];
      moving[m] += joint[f][m];
    }
  Joint ratios{};
  information = 0;
  for (int f = 0; f < kBins; ++f)
    for (int m = 0; m < kBins; ++m) {
      if (joint[f][m] <= 0) continue;
      ratios[f][m] = std::log(joint[f][m] / moving[m]);
      information += joint[f][m] * (ratios[f][m] - std::log(fixed[f]));
    }
  return ratios;
}

}  // namespace

double ncc(const Pair& pair, std::vector<float>* slope) {
  count_of(pair);
  return correlation(pair.fixed, pair.moving, pair.mask, slope);
}

double gradient_ncc(const Pair& pair, std::vector<float>* slope) {
  count_of(pair);
  const std::vector<std::uint8_t> counted = within_filter(pair.mask, pair.width, pair.height);
  const Edges fixed = edges_of(pair.fixed, pair.width, pair.height),
              moving = edges_of(pair.moving, pair.width, pair.height);
  Edges slopes;
  const double across = correlation(fixed.across, moving.across, counted, slope ? &slopes.across : nullptr),
               down = correlation(fixed.down, moving.down, counted, slope ? &slopes.down : nullptr);
  if (slope) {
    *slope = transposed_edges(slopes, pair.width, pair.height);
    for (float& s : *slope) s /= 2;
  }
  return (across + down) / 2;
}

double mutual_information(const Pair& pair, std::vector<float>* slope) {
  const std::size_t count = count_of(pair);
  if (slope) slope->assign(count, 0);
  const Greys fixed = greys_of(pair.fixed, pair.mask, kBins),
              moving = greys_of(pair.moving, pair.mask, kBins - 2 * kPadding);
  if (!(fixed.bin > 0) || !(moving.bin > 0)) return 0;
  const auto place = [&](std::size_t i) {
    return Place{std::clamp(static_cast<int>((pair.fixed[i] - fixed.lowest) / fixed.bin), 0, kBins - 1),
                 (pair.moving[i] - moving.lowest) / moving.bin + kPadding - 0.5};
  };
  Joint joint{};
  double pixels = 0;
  for_each_counted(pair.mask, count, [&](std::size_t i) {
    const Place at = place(i);
    pixels += 1;
    for (int m = at.first(); m < at.first() + 4; ++m) joint[at.fixed][m] += cubic(m - at.moving);
  });
  for (auto& row : joint)
    for (double& p : row) p /= pixels;
  double information = 0;
  const Joint ratios = log_ratios(joint, information);
  if (slope)
    for_each_counted(pair.mask, count, [&](std::size_t i) {
      const Place at = place(i);
      double sum = 0;
      for (int m = at.first(); m < at.first() + 4; ++m)
        sum -= ratios[at.fixed][m] * cubic_slope(m - at.moving);
      (*slope)[i] = static_cast<float>(sum / (pixels * moving.bin));
    });
  return information;
}

}  // namespace xraycast::similarity
