#include "xraycast/display/starved_pixels.hpp"

#include "xraycast/display/display_loops.hpp"

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
  for_bands(size_, [&](int first, int end) {
    std::copy_n(logarithm.data() + size_.row(first), size_.row(end - first),
                calmed_.data() + size_.row(first));
    for (int j = first; j < end; ++j)
      if (is_starved_[static_cast<std::size_t>(j)]) calm_row(j, codes, limit);
  });
  return calmed_;
}

void StarvedPixels::calm_row(int j, const std::vector<std::uint16_t>& codes, float starved_below) {
  const auto width = static_cast<std::size_t>(size_.width);
  // Sums of columns, which beyond the ends are as there.
  thread_local PixelPlane sums;
  sums.assign(width + 2 * kReach, 0);
  for (int k = j - kReach; k <= j + kReach; ++k) {
    const std::uint16_t* const row = codes.data() + size_.row(std::clamp(k, 0, size_.height - 1));
    for (std::size_t i = 0; i < width; ++i) sums[i + kReach] += row[i];
  }
  std::fill_n(sums.begin(), kReach, sums[kReach]);
  std::fill_n(sums.end() - kReach, kReach, sums[width + kReach - 1]);
  static_assert(kReach == 2, "calmed_row sums five columns");
  const Calming by{.dark = noise_.dark,
                   .below = starved_below,
                   .electronic = noise_.electronic,
                   .per_code = noise_.per_code,
                   .most_noise = kMostNoise,
                   .least_share = kLeastShare,
                   .least_level = std::max(kLeastNoises * noise_.electronic, 1.0f)};
  calmed_row(codes.data() + size_.row(j), sums.data() + kReach, by, size_.width,
             calmed_.data() + size_.row(j));
}

}  // namespace xraycast
