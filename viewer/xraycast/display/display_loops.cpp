#include "xraycast/display/display_loops.hpp"

#include "xraycast/base/quick_math.hpp"
#include "xraycast/base/wide_vectors.hpp"

#include <cmath>

namespace xraycast {

XRAYCAST_WIDE_VECTORS
void added_row(const float* __restrict row, int count, float* __restrict sums) {
  for (int i = 0; i < count; ++i) sums[i] += row[i];
}

XRAYCAST_WIDE_VECTORS
void moved_row(const float* __restrict entering, const float* __restrict leaving, int count,
               float* __restrict sums) {
  for (int i = 0; i < count; ++i) sums[i] += entering[i] - leaving[i];
}

XRAYCAST_WIDE_VECTORS
void enhanced_row(const float* __restrict row, const float* __restrict near, const float* __restrict wide,
                  const Enhancement& by, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = 0;
  for (int k = -by.reach; k <= by.reach; ++k) {
    const float* const column = wide + k;
    for (int i = 0; i < count; ++i) out[i] += column[i];
  }
  const int side = 2 * by.reach + 1;
  const float per_wide = 1.0f / static_cast<float>(side * side), strength = by.strength,
              darker = by.most_darker, lighter = by.most_lighter;
  for (int i = 0; i < count; ++i) {
    const float above = (near[i - 1] + near[i] + near[i + 1]) / 9 - out[i] * per_wide,
                within = above < -darker ? -darker : (above > lighter ? lighter : above);
    out[i] = row[i] + strength * within;
  }
}

XRAYCAST_WIDE_VECTORS
void calmed_row(const std::uint16_t* __restrict codes, const float* __restrict columns, const Calming& by,
                int count, float* __restrict logarithm) {
  const auto [dark, below, electronic, per_code, most_noise, least_share, least_level] = by;
  const float variance = electronic * electronic;
  for (int i = 0; i < count; ++i) {
    const float* const at = columns + i;
    const float mean = (at[-2] + at[-1] + at[0] + at[1] + at[2]) / 25 - dark,
                level = mean > least_level ? mean : least_level,
                noise = most_noise * level / std::sqrt(variance + per_code * level),
                share = noise < 1 ? noise : 1, least = least_share * level,
                drawn = level + share * (static_cast<float>(codes[i]) - dark - level),
                calm = quick_log(drawn > least ? drawn : least);
    logarithm[i] = mean < below ? calm : logarithm[i];
  }
}

XRAYCAST_WIDE_VECTORS
void summed_row(const float* __restrict above, const float* __restrict row, const float* __restrict below,
                int count, std::int16_t* __restrict out) {
  constexpr float kPerUnit = 1000, kMost = 3600;
  for (int i = 0; i < count; ++i) {
    const float sum = kPerUnit * (above[i] + above[i + 1] + above[i + 2] + row[i] + row[i + 1] + row[i + 2] +
                                  below[i] + below[i + 1] + below[i + 2]);
    out[i] = static_cast<std::int16_t>(static_cast<int>(sum > -kMost ? (sum < kMost ? sum : kMost) : -kMost));
  }
}

XRAYCAST_WIDE_VECTORS
void stronger_line_row(const std::int16_t* __restrict pixels, std::ptrdiff_t step, int count,
                       std::int16_t* __restrict lines) {
  for (int i = 0; i < count; ++i) {
    const std::int16_t* const at = pixels + i;
    const auto sum = static_cast<std::int16_t>(at[0] + at[step] + at[-step] + at[2 * step] + at[-2 * step] +
                                               at[3 * step] + at[-3 * step] + at[4 * step] + at[-4 * step]);
    const auto opposite = static_cast<std::int16_t>(-sum);
    const std::int16_t size = sum > opposite ? sum : opposite;
    lines[i] = lines[i] > size ? lines[i] : size;
  }
}

XRAYCAST_WIDE_VECTORS
void above_row(const std::int16_t* __restrict lines, const float* __restrict usual, float times, int count,
               std::uint8_t* __restrict above) {
  for (int i = 0; i < count; ++i) above[i] = static_cast<float>(lines[i]) > times * usual[i] ? 1 : 0;
}

XRAYCAST_WIDE_VECTORS
void united_row(const std::uint8_t* __restrict one, int count, std::uint8_t* __restrict either) {
  for (int i = 0; i < count; ++i) either[i] = static_cast<std::uint8_t>(either[i] | one[i]);
}

XRAYCAST_WIDE_VECTORS
void recursive_row(const float* __restrict now, const std::int16_t* __restrict lines,
                   const float* __restrict usual, const std::uint8_t* __restrict moved,
                   const FrameWeight& weight, int count, float* __restrict shown) {
  const float still = weight.still, from = weight.from, more = 1 - still, per = 1 / (weight.to - weight.from);
  for (int i = 0; i < count; ++i) {
    const float beyond = (static_cast<float>(lines[i]) / (usual[i] + 1e-12f) - from) * per,
                by_line = beyond < 0 ? 0 : (beyond > 1 ? 1 : beyond), share = moved[i] != 0 ? 1 : by_line;
    shown[i] += (still + more * share) * (now[i] - shown[i]);
  }
}

XRAYCAST_WIDE_VECTORS
void windowed_row(const float* __restrict logarithm, float per_log, float middle, int count,
                  std::uint8_t* __restrict grey) {
  for (int i = 0; i < count; ++i) {
    const float value = logarithm[i] * per_log + middle;
    grey[i] = static_cast<std::uint8_t>(static_cast<int>(value > 0 ? (value < 255 ? value : 255) : 0));
  }
}

XRAYCAST_WIDE_VECTORS
void windowed_row(const float* __restrict logarithm, const GreyLine& a, const GreyLine& b, int count,
                  std::uint8_t* __restrict grey) {
  const float a_per_log = a.per_log, a_at_zero = a.at_zero, b_per_log = b.per_log, b_at_zero = b.at_zero;
  for (int i = 0; i < count; ++i) {
    const float by_a = logarithm[i] * a_per_log + a_at_zero, by_b = logarithm[i] * b_per_log + b_at_zero,
                value = by_a > by_b ? by_a : by_b;
    grey[i] = static_cast<std::uint8_t>(static_cast<int>(value > 0 ? (value < 255 ? value : 255) : 0));
  }
}

XRAYCAST_WIDE_VECTORS
void compressed_row(const float* __restrict logarithm, const float* __restrict slope,
                    const float* __restrict start, float offset, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = logarithm[i] - slope[i] * logarithm[i] - start[i] + offset;
}

}  // namespace xraycast
