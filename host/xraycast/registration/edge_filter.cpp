#include "xraycast/registration/edge_filter.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace xraycast {
namespace {

constexpr int kReach = 3, kTaps = 2 * kReach + 1;  ///< of both filters below, from their middle

using Taps = std::array<float, kTaps>;
/// Binomial, a Gaussian of one pixel; and its central difference.
constexpr Taps kSmooth{0, 1 / 16.F, 4 / 16.F, 6 / 16.F, 4 / 16.F, 1 / 16.F, 0};
constexpr Taps kSlope{-1 / 32.F, -4 / 32.F, -5 / 32.F, 0, 5 / 32.F, 4 / 32.F, 1 / 32.F};

struct Size {
  int width, height;
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
  std::size_t count() const { return at(0, height); }
};

/// Filters a line of `count` values, `step` apart. The border's value goes on beyond it.
void filter_line(const float* from, float* to, int count, std::size_t step, const Taps& taps) {
  const auto value = [&](int i) {
    return from[static_cast<std::size_t>(std::clamp(i, 0, count - 1)) * step];
  };
  for (int i = 0; i < count; ++i) {
    float sum = 0;
    for (int t = 0; t < kTaps; ++t) sum += taps[static_cast<std::size_t>(t)] * value(i + t - kReach);
    to[static_cast<std::size_t>(i) * step] = sum;
  }
}

void spread_line(const float* from, float* to, int count, std::size_t step, const Taps& taps) {
  for (int i = 0; i < count; ++i)
    for (int t = 0; t < kTaps; ++t)
      to[static_cast<std::size_t>(std::clamp(i + t - kReach, 0, count - 1)) * step] +=
          taps[static_cast<std::size_t>(t)] * from[static_cast<std::size_t>(i) * step];
}

std::vector<float> filtered(std::span<const float> picture, const Size& size, const Taps& across,
                            const Taps& down) {
  std::vector<float> rows(size.count()), both(size.count());
  for (int y = 0; y < size.height; ++y)
    filter_line(&picture[size.at(0, y)], &rows[size.at(0, y)], size.width, 1, across);
  // Row by row, so that memory is read in order.
  for (int y = 0; y < size.height; ++y)
    for (int t = 0; t < kTaps; ++t) {
      const float tap = down[static_cast<std::size_t>(t)];
      if (tap == 0) continue;
      const float* const from = &rows[size.at(0, std::clamp(y + t - kReach, 0, size.height - 1))];
      float* const to = &both[size.at(0, y)];
      for (int x = 0; x < size.width; ++x) to[x] += tap * from[x];
    }
  return both;
}

void add_transposed(std::span<const float> slopes, const Size& size, const Taps& across, const Taps& down,
                    std::span<float> sum) {
  std::vector<float> columns(size.count());
  for (int x = 0; x < size.width; ++x)
    spread_line(&slopes[size.at(x, 0)], &columns[size.at(x, 0)], size.height,
                static_cast<std::size_t>(size.width), down);
  for (int y = 0; y < size.height; ++y)
    spread_line(&columns[size.at(0, y)], &sum[size.at(0, y)], size.width, 1, across);
}

}  // namespace

Edges edges_of(std::span<const float> picture, int width, int height) {
  const Size size{width, height};
  return {filtered(picture, size, kSlope, kSmooth), filtered(picture, size, kSmooth, kSlope)};
}

std::vector<float> transposed_edges(const Edges& slopes, int width, int height) {
  const Size size{width, height};
  std::vector<float> sum(size.count());
  add_transposed(slopes.across, size, kSlope, kSmooth, sum);
  add_transposed(slopes.down, size, kSmooth, kSlope, sum);
  return sum;
}

std::vector<std::uint8_t> within_filter(std::span<const std::uint8_t> mask, int width, int height) {
  const Size size{width, height};
  std::vector<std::uint8_t> rows(size.count()), both(size.count());
  const auto is_in = [&](int x, int y) { return mask.empty() || mask[size.at(x, y)] != 0; };
  for (int y = 0; y < height; ++y)
    for (int x = kReach, run = 0; x < width; ++x) {
      if (x == kReach)
        for (int k = 0; k < kReach; ++k) run = is_in(k, y) ? run + 1 : 0;
      run = is_in(x, y) ? run + 1 : 0;
      if (run > 2 * kReach) rows[size.at(x - kReach, y)] = 1;
    }
  for (int x = 0; x < width; ++x)
    for (int y = 0, run = 0; y < height; ++y) {
      run = rows[size.at(x, y)] != 0 ? run + 1 : 0;
      if (run > 2 * kReach) both[size.at(x, y - kReach)] = 1;
    }
  return both;
}

}  // namespace xraycast
