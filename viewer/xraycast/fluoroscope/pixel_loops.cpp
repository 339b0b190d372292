#include "xraycast/fluoroscope/pixel_loops.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/display/picture_rows.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace xraycast {
namespace {

// Filters keep the sums of as many pixels in registers as AVX2 has room for.
constexpr int kEights = 4, kBlock = 8 * kEights;
using Eight = float __attribute__((vector_size(32), aligned(4), may_alias));

using Four = float __attribute__((vector_size(16), may_alias));
using UnalignedFour = float __attribute__((vector_size(16), aligned(4), may_alias));

/// The three values of a step at a place between it and the next one.
inline Four between(const QuantaTable::Step* step, float part) {
  const Four& from = *reinterpret_cast<const Four*>(step);
  const Four& to = *reinterpret_cast<const Four*>(step + 1);
  return from + part * (to - from);
}

inline Eight& eight_at(float* pixels) { return *reinterpret_cast<Eight*>(pixels); }
inline const Eight& eight_at(const float* pixels) { return *reinterpret_cast<const Eight*>(pixels); }
inline UnalignedFour& four_at(float* pixels) { return *reinterpret_cast<UnalignedFour*>(pixels); }

/// A spread of light never leaves a pixel darker than those about it. A filter of negative weights, which has
/// the right transfer, would next to a beam that is a hundred times as bright: what it sums is at least
/// nearly the least of the pixel and both neighbours. Where contrasts are small this changes nothing.
constexpr float kLeastOfNeighbours = 0.9f;

inline bool rings(const SymmetricTaps& taps) { return *std::min_element(taps.begin(), taps.end()) < 0; }

inline float bounded(float sum, float left, float middle, float right) {
  return std::max(sum, kLeastOfNeighbours * std::min({left, middle, right}));
}

inline void bound(Eight& sums, const Eight& left, const Eight& middle, const Eight& right) {
  const Eight of_both = left < right ? left : right;
  const Eight least = kLeastOfNeighbours * (of_both < middle ? of_both : middle);
  sums = sums < least ? least : sums;
}

inline float sum_of(const Eight& values) {
  return ((values[0] + values[1]) + (values[2] + values[3])) +
         ((values[4] + values[5]) + (values[6] + values[7]));
}

}  // namespace

XRAYCAST_WIDE_VECTORS
void look_up_row(const QuantaTable& table, const float* __restrict tau, int count, float* __restrict share,
                 float* __restrict mean_kev, float* __restrict spread_kev) {
  constexpr int kRun = 256;
  std::int32_t step[kRun];
  float part[kRun];
  const float per_tau = table.steps_per_tau;
  const int last = static_cast<int>(table.steps.size()) - 2;
  const auto end = static_cast<float>(last + 1);
  const QuantaTable::Step* const steps = table.steps.data();
  for (int start = 0; start < count; start += kRun) {
    const int run = std::min(kRun, count - start);
    for (int i = 0; i < run; ++i) {
      const float wanted = tau[start + i] * per_tau, positive = wanted > 0 ? wanted : 0;  // 0 for NaN
      const float at = positive < end ? positive : end;
      const int below = static_cast<int>(at);
      step[i] = below < last ? below : last;
      part[i] = at - static_cast<float>(step[i]);
    }
    int i = 0;
    for (; i + 4 <= run; i += 4) {
      const Four a = between(steps + step[i], part[i]), b = between(steps + step[i + 1], part[i + 1]),
                 c = between(steps + step[i + 2], part[i + 2]), d = between(steps + step[i + 3], part[i + 3]);
      // Shares and means of two pixels, then of four.
      const Four ab = __builtin_shufflevector(a, b, 0, 4, 1, 5),
                 cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
      four_at(share + start + i) = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
      four_at(mean_kev + start + i) = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
      const Four spread_ab = __builtin_shufflevector(a, b, 2, 6, 3, 7),
                 spread_cd = __builtin_shufflevector(c, d, 2, 6, 3, 7);
      four_at(spread_kev + start + i) = __builtin_shufflevector(spread_ab, spread_cd, 0, 1, 4, 5);
    }
    for (; i < run; ++i) {
      const Four one = between(steps + step[i], part[i]);
      share[start + i] = one[0];
      mean_kev[start + i] = one[1];
      spread_kev[start + i] = one[2];
    }
  }
}

XRAYCAST_WIDE_VECTORS
void add_to_cells_row(const float* __restrict share, const float* __restrict field, int count,
                      float* __restrict cell_share, float* __restrict cell_primary) {
  constexpr int kCell = PictureSize::kBand;
  for (int start = 0; start < count; start += kCell, ++cell_share, ++cell_primary) {
    const int end = std::min(count, start + kCell);
    int i = start;
    for (; i + 8 <= end; i += 8) {
      const Eight shares = eight_at(share + i), primary = shares * eight_at(field + i);
      *cell_share += sum_of(shares);
      *cell_primary += sum_of(primary);
    }
    for (; i < end; ++i) {
      *cell_share += share[i];
      *cell_primary += share[i] * field[i];
    }
  }
}

XRAYCAST_WIDE_VECTORS
void filter_row(const float* __restrict padded, const SymmetricTaps& taps, int count, float* __restrict out) {
  const int neighbours = static_cast<int>(taps.size()) - 1;
  const float* const middle = padded + neighbours;
  const bool is_bounded = rings(taps);
  int i = 0;
  for (; i + kBlock <= count; i += kBlock) {
    Eight sums[kEights];
    for (int e = 0; e < kEights; ++e) sums[e] = taps[0] * eight_at(middle + i + 8 * e);
    for (int k = 1; k <= neighbours; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      const float *const left = middle + i - k, *const right = middle + i + k;
      for (int e = 0; e < kEights; ++e) sums[e] += tap * (eight_at(left + 8 * e) + eight_at(right + 8 * e));
    }
    if (is_bounded)
      for (int e = 0; e < kEights; ++e) {
        const float* const at = middle + i + 8 * e;
        bound(sums[e], eight_at(at - 1), eight_at(at), eight_at(at + 1));
      }
    for (int e = 0; e < kEights; ++e) eight_at(out + i + 8 * e) = sums[e];
  }
  for (; i < count; ++i) {
    float sum = taps[0] * middle[i];
    for (int k = 1; k <= neighbours; ++k)
      sum += taps[static_cast<std::size_t>(k)] * (middle[i - k] + middle[i + k]);
    out[i] = is_bounded ? bounded(sum, middle[i - 1], middle[i], middle[i + 1]) : sum;
  }
}

namespace {

/// Both functions below, for which it is compiled apart.
template <bool kAdds>
__attribute__((always_inline)) inline void filtered_column(const float* const* rows,
                                                           const SymmetricTaps& taps, float weight, int count,
                                                           float* __restrict out) {
  const int neighbours = static_cast<int>(taps.size()) - 1;
  const bool is_bounded = rings(taps);
  int i = 0;
  for (; i + kBlock <= count; i += kBlock) {
    Eight sums[kEights];
    for (int e = 0; e < kEights; ++e) sums[e] = taps[0] * eight_at(rows[neighbours] + i + 8 * e);
    for (int k = 1; k <= neighbours; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      const float *const above = rows[neighbours - k] + i, *const below = rows[neighbours + k] + i;
      for (int e = 0; e < kEights; ++e) sums[e] += tap * (eight_at(above + 8 * e) + eight_at(below + 8 * e));
    }
    if (is_bounded)
      for (int e = 0; e < kEights; ++e) {
        const int at = i + 8 * e;
        bound(sums[e], eight_at(rows[neighbours - 1] + at), eight_at(rows[neighbours] + at),
              eight_at(rows[neighbours + 1] + at));
      }
    for (int e = 0; e < kEights; ++e) {
      const Eight weighted = weight * sums[e];
      eight_at(out + i + 8 * e) = kAdds ? eight_at(out + i + 8 * e) + weighted : weighted;
    }
  }
  for (; i < count; ++i) {
    float sum = taps[0] * rows[neighbours][i];
    for (int k = 1; k <= neighbours; ++k)
      sum += taps[static_cast<std::size_t>(k)] * (rows[neighbours - k][i] + rows[neighbours + k][i]);
    if (is_bounded) sum = bounded(sum, rows[neighbours - 1][i], rows[neighbours][i], rows[neighbours + 1][i]);
    out[i] = kAdds ? out[i] + weight * sum : weight * sum;
  }
}

}  // namespace

XRAYCAST_WIDE_VECTORS
void filter_column(const float* const* rows, const SymmetricTaps& taps, float weight, int count, float* out) {
  filtered_column<false>(rows, taps, weight, count, out);
}

XRAYCAST_WIDE_VECTORS
void add_filtered_column(const float* const* rows, const SymmetricTaps& taps, float weight, int count,
                         float* out) {
  filtered_column<true>(rows, taps, weight, count, out);
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
    if (most_bits == 0) {
      std::fill_n(quanta + start, run, 0.0f);
      continue;
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
    for (int k = 1; k <= numbers; ++k) {
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

}  // namespace xraycast
