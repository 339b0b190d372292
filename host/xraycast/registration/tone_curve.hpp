#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace xraycast {

/// How an X-ray's greys say what attenuates: they fall or grow with it, as intensities or as their logarithm.
enum class Tone { intensity, log_intensity, inverted_intensity, inverted_log_intensity };
inline constexpr std::array kTones{Tone::log_intensity, Tone::intensity, Tone::inverted_log_intensity,
                                   Tone::inverted_intensity};

/// Optical depth, up to its scale and offset, by an X-ray's greys, as shares from the darkest to the
/// lightest.
class ToneCurve {
 public:
  explicit ToneCurve(Tone tone);

  /// The monotone curve nearest to the depths that a projection has where the X-ray has those shares: means
  /// over pixels of about one grey, by isotonic regression (Barlow et al., 1972). All of one size; pixels
  /// that are not `counted` do not matter. Where they tell nothing, it is that of `otherwise`.
  static ToneCurve fitted(std::span<const float> shares, std::span<const float> depths,
                          std::span<const std::uint8_t> counted, const ToneCurve& otherwise);

  float operator()(float share) const {
    const float at = share * (kSamples - 1);
    const auto i = static_cast<std::size_t>(at) < kSamples - 2 ? static_cast<std::size_t>(at) : kSamples - 2;
    return depths_[i] + (at - static_cast<float>(i)) * (depths_[i + 1] - depths_[i]);
  }

 private:
  static constexpr std::size_t kSamples = 1025;
  std::array<float, kSamples> depths_{};
};

}  // namespace xraycast
