#include "xraycast/fluoroscope/pixel_loops.hpp"

#include "xraycast/base/wide_vectors.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace xraycast {
namespace {

// Filters keep the sums of as many pixels in registers as AVX2 has room for.
constexpr int kEights = 4, kBlock = 8 * kEights;
using Eight = float __attribute__((vector_size(32), aligned(4), may_alias));

inline Eight& eight_at(float* pixels) { return *reinterpret_cast<Eight*>(pixels); }
inline const Eight& eight_at(const float* pixels) { return *reinterpret_cast<const Eight*>(pixels); }

}  // namespace

XRAYCAST_WIDE_VECTORS
void look_up_row(const QuantaTable& table, const float* __restrict tau, int count, float* __restrict share,
                 float* __restrict mean_kev, float* __restrict spread_kev) {
  const float per_tau = table.steps_per_tau;
  const int last = static_cast<int>(table.share.size()) - 2;
  const auto end = static_cast<float>(last + 1);
  const float* __restrict shares = table.share.data();
  const float* __restrict means = table.mean_kev.data();
  const float* __restrict spreads = table.spread_kev.data();
  for (int i = 0; i < count; ++i) {
    const float wanted = tau[i] * per_tau, positive = wanted > 0 ? wanted : 0;  // 0 for NaN
    const float at = positive < end ? positive : end;
    const int below = static_cast<int>(at), step = below < last ? below : last;
    const float part = at - static_cast<float>(step);
    share[i] = shares[step] + part * (shares[step + 1] - shares[step]);
    mean_kev[i] = means[step] + part * (means[step + 1] - means[step]);
    spread_kev[i] = spreads[step] + part * (spreads[step + 1] - spreads[step]);
  }
}

XRAYCAST_WIDE_VECTORS
void filter_row(const float* __restrict padded, const SymmetricTaps& taps, int count, float* __restrict out) {
  const int neighbours = static_cast<int>(taps.size()) - 1;
  const float* const middle = padded + neighbours;
  int i = 0;
  for (; i + kBlock <= count; i += kBlock) {
    Eight sums[kEights];
    for (int e = 0; e < kEights; ++e) sums[e] = taps[0] * eight_at(middle + i + 8 * e);
    for (int k = 1; k <= neighbours; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      const float *const left = middle + i - k, *const right = middle + i + k;
      for (int e = 0; e < kEights; ++e) sums[e] += tap * (eight_at(left + 8 * e) + eight_at(right + 8 * e));
    }
    for (int e = 0; e < kEights; ++e) eight_at(out + i + 8 * e) = sums[e];
  }
  for (; i < count; ++i) {
    float sum = taps[0] * middle[i];
    for (int k = 1; k <= neighbours; ++k)
      sum += taps[static_cast<std::size_t>(k)] * (middle[i - k] + middle[i + k]);
    out[i] = sum;
  }
}

XRAYCAST_WIDE_VECTORS
void add_filtered_column(const float* const* rows, const SymmetricTaps& taps, float weight, int count,
                         float* __restrict out) {
  const int neighbours = static_cast<int>(taps.size()) - 1;
  int i = 0;
  for (; i + kBlock <= count; i += kBlock) {
    Eight sums[kEights];
    for (int e = 0; e < kEights; ++e) sums[e] = taps[0] * eight_at(rows[neighbours] + i + 8 * e);
    for (int k = 1; k <= neighbours; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      const float *const above = rows[neighbours - k] + i, *const below = rows[neighbours + k] + i;
      for (int e = 0; e < kEights; ++e) sums[e] += tap * (eight_at(above + 8 * e) + eight_at(below + 8 * e));
    }
    for (int e = 0; e < kEights; ++e) eight_at(out + i + 8 * e) += weight * sums[e];
  }
  for (; i < count; ++i) {
    float sum = taps[0] * rows[neighbours][i];
    for (int k = 1; k <= neighbours; ++k)
      sum += taps[static_cast<std::size_t>(k)] * (rows[neighbours - k][i] + rows[neighbours + k][i]);
    out[i] += weight * sum;
  }
}

XRAYCAST_WIDE_VECTORS
void quanta_counts_row(const float* __restrict share, const float* __restrict field,
                       const float* __restrict scatter, float open_quanta, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const float expected = open_quanta * (share[i] * field[i] + scatter[i]);
    out[i] = expected < kMostQuanta ? expected : kMostQuanta;
  }
}

XRAYCAST_WIDE_VECTORS
void normals_row(std::uint32_t first, NoiseStream noise, int count, float* __restrict one,
                 float* __restrict other) {
  constexpr int kRun = 256;
  std::uint32_t low[kRun], high[kRun];
  for (int start = 0; start < count; start += kRun) {
    const int run = std::min(kRun, count - start);
    for (int i = 0; i < run; ++i) {
      const RandomPair random =
          random_pair(first + static_cast<std::uint32_t>(start + i), noise.frame, noise.key);
      low[i] = random.first;
      high[i] = random.second;
    }
    for (int i = 0; i < run; ++i) {
      const NormalPair normal = normals_of({low[i], high[i]});
      one[start + i] = normal.first;
      other[start + i] = normal.second;
    }
  }
}

XRAYCAST_WIDE_VECTORS
void few_quanta_row(const float* __restrict means, std::uint32_t first, NoiseStream noise, int count,
                    float* __restrict quanta) {
  constexpr int kRun = 64;
  float mean[kRun], term[kRun], sum[kRun], uniform[kRun], number[kRun];
  for (int start = 0; start < count; start += kRun) {
    const int run = std::min(kRun, count - start);
    std::int32_t most_bits = 0;  // of floats above 0, which are ordered as their bits are
    for (int i = 0; i < run; ++i) {
      const float positive = means[start + i] > 0 ? means[start + i] : 0;
      mean[i] = positive < kLeastExpandedMean ? positive : 0;
      most_bits = std::max(most_bits, std::bit_cast<std::int32_t>(mean[i]));
    }
    const float most = std::bit_cast<float>(most_bits);
    for (int i = 0; i < run; ++i) {
      uniform[i] = uniform_of(
          random_pair(first + static_cast<std::uint32_t>(start + i), noise.frame, noise.key).first);
      term[i] = quick_exp(-mean[i]);
      sum[i] = term[i];
      number[i] = 0;
    }
    // Beyond that number the distribution is below what a float of 24 bits resolves.
    const int numbers = static_cast<int>(most + 7 * std::sqrt(most) + 6);
    for (int k = 1; most > 0 && k <= numbers; ++k) {
      const float per_number = 1 / static_cast<float>(k);
      for (int i = 0; i < run; ++i) {
        number[i] += uniform[i] > sum[i] ? 1.0f : 0.0f;
        term[i] *= mean[i] * per_number;
        sum[i] += term[i];
      }
    }
    for (int i = 0; i < run; ++i) quanta[start + i] = number[i];
  }
}

XRAYCAST_WIDE_VECTORS
void quantum_noise_row(const float* __restrict counts, const float* __restrict mean_kev,
                       const float* __restrict spread_kev, std::uint32_t first_pixel, NoiseStream noise,
                       NoiseStream few, int count, float* __restrict energy_kev, float* __restrict normals) {
  float* __restrict spreading = normals + count;
  normals_row(first_pixel, noise, count, normals, spreading);
  std::int32_t few_pixels = 0;
  for (int i = 0; i < count; ++i) few_pixels += counts[i] < kLeastExpandedMean ? 1 : 0;
  for (int i = 0; i < count; ++i) {
    const float expected = counts[i] > kLeastExpandedMean ? counts[i] : kLeastExpandedMean;
    const float quanta = poisson_quantile(expected, normals[i]);
    const float energy = quanta * mean_kev[i] + std::sqrt(quanta) * spread_kev[i] * spreading[i];
    energy_kev[i] = energy > 0 ? energy : 0;
  }
  if (few_pixels == 0) return;
  float* __restrict quanta = normals;  // read for the last time
  few_quanta_row(counts, first_pixel, few, count, quanta);
  for (int i = 0; i < count; ++i) {
    const float energy = quanta[i] * mean_kev[i] + std::sqrt(quanta[i]) * spread_kev[i] * spreading[i];
    const float positive = energy > 0 ? energy : 0, missing = counts[i] < 0 ? counts[i] : 0;
    energy_kev[i] = counts[i] < kLeastExpandedMean ? positive + missing * mean_kev[i] : energy_kev[i];
  }
}

XRAYCAST_WIDE_VECTORS
void expected_energy_row(const float* __restrict counts, const float* __restrict mean_kev, int count,
                         float* __restrict energy_kev) {
  for (int i = 0; i < count; ++i) energy_kev[i] = counts[i] * mean_kev[i];
}

XRAYCAST_WIDE_VECTORS
void lag_row(float fraction, float decayed, int count, const float* __restrict signal, float* __restrict kept,
             float* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const float released = decayed * kept[i], trapped = fraction * signal[i];
    out[i] += released - trapped;
    kept[i] += trapped - released;
  }
}

XRAYCAST_WIDE_VECTORS
void electronic_noise_row(float rms_kev, std::uint32_t first_pixel, NoiseStream noise, int count,
                          float* __restrict signal, float* __restrict normals) {
  const int half = (count + 1) / 2;
  normals_row(first_pixel, noise, half, normals, normals + half);
  for (int i = 0; i < count; ++i) signal[i] += rms_kev * normals[i];
}

XRAYCAST_WIDE_VECTORS
void digitise_row(const Digitiser& digitiser, int count, const float* __restrict signal,
                  std::uint16_t* __restrict codes) {
  const auto [codes_per_kev, dark, most] = digitiser;
  for (int i = 0; i < count; ++i) {
    const float code = signal[i] * codes_per_kev + dark + 0.5f;
    codes[i] = static_cast<std::uint16_t>(static_cast<int>(code > 0 ? (code < most ? code : most) : 0));
  }
}

XRAYCAST_WIDE_VECTORS
void signal_of_codes_row(const Digitiser& digitiser, int count, const std::uint16_t* __restrict codes,
                         float* __restrict signal) {
  const float codes_per_kev = digitiser.codes_per_kev, dark = digitiser.dark;
  for (int i = 0; i < count; ++i) signal[i] = (static_cast<float>(codes[i]) - dark) / codes_per_kev;
}

XRAYCAST_WIDE_VECTORS
void sharpened_row(const float* __restrict above, const float* __restrict row, const float* __restrict below,
                   float strength, int count, float* __restrict out) {
  const float own = 1 + strength, around = strength / 9;
  for (int i = 0; i < count; ++i) {
    const float sum = above[i] + above[i + 1] + above[i + 2] + row[i] + row[i + 1] + row[i + 2] + below[i] +
                      below[i + 1] + below[i + 2];
    out[i] = own * row[i + 1] - around * sum;
  }
}

XRAYCAST_WIDE_VECTORS
void recursive_row(const float* __restrict now, float weight, int count, float* __restrict shown) {
  for (int i = 0; i < count; ++i) shown[i] += weight * (now[i] - shown[i]);
}

XRAYCAST_WIDE_VECTORS
void windowed_row(const float* __restrict logarithm, float per_log, float middle, int count,
                  std::uint8_t* __restrict grey) {
  for (int i = 0; i < count; ++i) {
    const float value = logarithm[i] * per_log + middle;
    grey[i] = static_cast<std::uint8_t>(static_cast<int>(value > 0 ? (value < 255 ? value : 255) : 0));
  }
}

}  // namespace xraycast
