#pragma once

#include <bit>
#include <cstdint>

// Free of branches and calls, so that compilers vectorise loops over pixels.
namespace xraycast {

/// The natural logarithm of a normal float above 0, to 2e-7.
inline float quick_log(float value) {
  constexpr std::int32_t kSqrtHalf = 0x3F3504F3, kMantissa = 0x007FFFFF;
  const std::int32_t bits = std::bit_cast<std::int32_t>(value) - kSqrtHalf;
  const float exponent = static_cast<float>(bits >> 23);
  const float mantissa = std::bit_cast<float>((bits & kMantissa) + kSqrtHalf);
  const float s = (mantissa - 1) / (mantissa + 1), s2 = s * s;
  constexpr float kLn2 = 0.693147181f;
  return exponent * kLn2 +
         s * (2 + s2 * (0.666666667f + s2 * (0.4f + s2 * (0.285714286f + s2 * 0.222222222f))));
}

/// e to the x for -20 <= x <= 0, to 3e-7.
inline float quick_exp(float x) {
  constexpr float kPerLn2 = 1.44269504f, kLn2 = 0.693147181f;
  const std::int32_t exponent = static_cast<std::int32_t>(x * kPerLn2 - 0.5f);
  const float rest = x - static_cast<float>(exponent) * kLn2;
  const float power =
      1 +
      rest * (1 + rest * (0.5f + rest * (0.166666667f +
                                         rest * (0.0416666667f + rest * (0.00833333333f +
                                                                         rest * (0.00138888889f +
                                                                                 rest * 0.000198412698f))))));
  constexpr std::int32_t kBias = 127, kMantissaBits = 23;
  return power * std::bit_cast<float>((exponent + kBias) << kMantissaBits);
}

}  // namespace xraycast
