#include "xraycast/fluoroscope/pixel_loops.hpp"

#include "xraycast/base/wide_vectors.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

XRAYCAST_WIDE_VECTORS
void look_up_row(const QuantaTable& table, const float* __restrict tau, int count, float* __restrict share,
                 float* __restrict mean_kev, float* __restrict spread_kev) {
  const float per_tau = table.steps_per_tau, last = static_cast<float>(table.share.size() - 2);
  const float* __restrict shares = table.share.data();
  const float* __restrict means = table.mean_kev.data();
  const float* __restrict spreads = table.spread_kev.data();
  for (int i = 0; i < count; ++i) {
    const float wanted = tau[i] * per_tau;
    const float at = wanted > 0 ? (wanted < last ? wanted : last) : 0;  // also where tau is NaN
    const int step = static_cast<int>(at);
    const float part = at - static_cast<float>(step);
    share[i] = shares[step] + part * (shares[step + 1] - shares[step]);
    mean_kev[i] = means[step];
    spread_kev[i] = spreads[step];
  }
}

XRAYCAST_WIDE_VECTORS
void filter_row(const float* __restrict padded, const SymmetricTaps& taps, int count, float* __restrict out) {
  const int neighbours = static_cast<int>(taps.size()) - 1;
  const float* __restrict middle = padded + neighbours;
  const float own = taps[0];
  for (int i = 0; i < count; ++i) out[i] = own * middle[i];
  for (int k = 1; k <= neighbours; ++k) {
    const float weight = taps[static_cast<std::size_t>(k)];
    const float* __restrict left = middle - k, * __restrict right = middle + k;
    for (int i = 0; i < count; ++i) out[i] += weight * (left[i] + right[i]);
  }
}

XRAYCAST_WIDE_VECTORS
void add_filtered_column(const float* const* rows, const SymmetricTaps& taps, float weight, int count,
                         float* __restrict out) {
  const int neighbours = static_cast<int>(taps.size()) - 1;
  const float* __restrict own = rows[neighbours];
  const float own_weight = weight * taps[0];
  for (int i = 0; i < count; ++i) out[i] += own_weight * own[i];
  for (int k = 1; k <= neighbours; ++k) {
    const float tap = weight * taps[static_cast<std::size_t>(k)];
    const float* __restrict above = rows[neighbours - k], * __restrict below = rows[neighbours + k];
    for (int i = 0; i < count; ++i) out[i] += tap * (above[i] + below[i]);
  }
}

XRAYCAST_WIDE_VECTORS
void quanta_counts_row(const float* __restrict share, const float* __restrict field,
                       const float* __restrict scatter, float open_quanta, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const float expected = open_quanta * (share[i] * field[i] + scatter[i]);
    out[i] = expected > 0 ? expected : 0;  // a fitted filter may overshoot beside an edge
  }
}

XRAYCAST_WIDE_VECTORS
void quantum_noise_row(const float* __restrict counts, const float* __restrict mean_kev,
                       const float* __restrict spread_kev, std::uint32_t first_pixel, NoiseStream noise,
                       int count, float* __restrict energy_kev) {
  for (int i = 0; i < count; ++i) {
    const RandomPair random = philox(first_pixel + static_cast<std::uint32_t>(i), noise.frame, noise.key);
    const NormalPair normal = normals_of(random);
    const float expected = counts[i] > kLeastExpandedMean ? counts[i] : kLeastExpandedMean;
    const float quanta = poisson_quantile(expected, normal.first);
    const float energy = quanta * mean_kev[i] + std::sqrt(quanta) * spread_kev[i] * normal.second;
    energy_kev[i] = energy > 0 ? energy : 0;
  }
  for (int i = 0; i < count; ++i) {
    if (counts[i] >= kLeastExpandedMean) continue;
    const RandomPair random = philox(first_pixel + static_cast<std::uint32_t>(i), noise.frame, noise.key);
    const float uniform = (static_cast<float>(random.first >> 8) + 0.5f) * 0x1p-24f;
    // The pair's second number turns; its first, used up by the count, must not be the spread's.
    const float normal = normals_of(philox(random.second, noise.frame, ~noise.key)).first;
    const float quanta = poisson_by_inversion(counts[i], uniform);
    energy_kev[i] = std::max(0.0f, quanta * mean_kev[i] + std::sqrt(quanta) * spread_kev[i] * normal);
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
                          float* __restrict signal) {
  const int half = (count + 1) / 2;
  for (int i = 0; i < count / 2; ++i) {
    const NormalPair normal =
        normals_of(philox(first_pixel + static_cast<std::uint32_t>(i), noise.frame, noise.key));
    signal[i] += rms_kev * normal.first;
    signal[i + half] += rms_kev * normal.second;
  }
  if (count % 2 == 1)
    signal[half - 1] +=
        rms_kev *
        normals_of(philox(first_pixel + static_cast<std::uint32_t>(half - 1), noise.frame, noise.key)).first;
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
