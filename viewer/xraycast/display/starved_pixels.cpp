#include "xraycast/display/starved_pixels.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr int kReach = 2;               // of the mean, to either side
constexpr float kMostNoise = 0.15f;     // of the mean
constexpr float kLeastShare = 0.2f;     // of it that is shown
constexpr float kLeastNoises = 0.125f;  // of the electronics: a mean that is less says nothing

/// The signal at which noise is kMostNoise of it.
float starved_below(const CodeNoise& noise) {
  const float share = kMostNoise * kMostNoise, half = 0.5f * noise.per_code / share;
  return half + std::sqrt(half * half + noise.electronic * noise.electronic / share);
}

}  // namespace

const PixelPlane& StarvedPixels::calmed(const std::vector<std::uint16_t>& codes,
                                        const PixelPlane& logarithm) {
  const float limit = starved_below(noise_);
  const auto code_limit = static_cast<std::uint16_t>(std::clamp(noise_.dark + limit, 0.0f, 65535.0f));
  is_starved_.assign(static_cast<std::size_t>(size_.height), 0);
  for_bands(size_, [&](int first, int end) {
    for (int j = first; j < end; ++j) {
      const std::uint16_t* const row = codes.data() + size_.row(j);
      std::uint16_t least = 65535;
      for (int i = 0; i < size_.width; ++i) least = row[i] < least ? row[i] : least;
      is_starved_[static_cast<std::size_t>(j)] = least < code_limit;
    }
  });
  if (std::none_of(is_starved_.begin(), is_starved_.end(), [](char is_starved) { return is_starved; }))
    return logarithm;
  calmed_ = logarithm;
  for_bands(size_, [&](int first, int end) {
    for (int j = first; j < end; ++j)
      if (is_starved_[static_cast<std::size_t>(j)]) calm_row(j, codes, limit);
  });
  return calmed_;
}

void StarvedPixels::calm_row(int j, const std::vector<std::uint16_t>& codes, float starved_below) {
  constexpr std::size_t kAside = kReach, kSide = 2 * kAside + 1;
  constexpr auto kPixels = static_cast<float>(kSide * kSide);
  const auto width = static_cast<std::size_t>(size_.width);
  // Sums of columns, which beyond the ends are as there.
  thread_local PixelPlane sums;
  sums.assign(width + 2 * kAside, 0);
  for (int k = j - kReach; k <= j + kReach; ++k) {
    const std::uint16_t* const row = codes.data() + size_.row(std::clamp(k, 0, size_.height - 1));
    for (std::size_t i = 0; i < width; ++i) sums[i + kAside] += row[i];
  }
  for (std::size_t i = 0; i < kAside; ++i) {
    sums[i] = sums[kAside];
    sums[width + kAside + i] = sums[width + kAside - 1];
  }
  const std::uint16_t* const row = codes.data() + size_.row(j);
  float* const out = calmed_.data() + size_.row(j);
  for (std::size_t i = 0; i < width; ++i) {
    float sum = 0;
    for (std::size_t k = 0; k < kSide; ++k) sum += sums[i + k];
    const float mean = sum / kPixels - noise_.dark;
    if (mean >= starved_below) continue;
    const float level = std::max({mean, kLeastNoises * noise_.electronic, 1.0f}),
                noise = std::sqrt(noise_.electronic * noise_.electronic + noise_.per_code * level),
                share = std::min(1.0f, kMostNoise * level / noise);
    out[i] = std::log(
        std::max(level + share * (static_cast<float>(row[i]) - noise_.dark - level), kLeastShare * level));
  }
}

}  // namespace xraycast
