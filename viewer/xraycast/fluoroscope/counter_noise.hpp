#pragma once

#include "xraycast/base/quick_math.hpp"

#include <cmath>
#include <cstdint>

// Random numbers as functions of what they are for, so that pictures do not depend on the number of threads.
// All of it is free of branches, so that compilers vectorise loops over pixels.
namespace xraycast {

/// Which use a random number is for.
enum class NoiseUse : std::uint32_t { quanta = 1, electronics = 2, few_quanta = 3 };

struct RandomPair {
  std::uint32_t first, second;
};

/// A hash of three numbers, pcg3d of M. Jarzynski and M. Olano, Hash functions for GPU rendering, J. Computer
/// Graphics Techniques 9(3), 2020: of those without visible or measured correlations the cheapest for vectors
/// of 32-bit numbers.
inline RandomPair random_pair(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  constexpr std::uint32_t kFactor = 1664525, kSummand = 1013904223;
  x = x * kFactor + kSummand;
  y = y * kFactor + kSummand;
  z = z * kFactor + kSummand;
  x += y * z;
  y += z * x;
  z += x * y;
  x ^= x >> 16;
  y ^= y >> 16;
  z ^= z >> 16;
  x += y * z;
  y += z * x;
  return {x, y};
}

/// One key per seed and use.
inline std::uint32_t noise_key(std::uint32_t seed, NoiseUse use) {
  return random_pair(seed, static_cast<std::uint32_t>(use), 0x5EEDu).first;
}

/// sin(pi x) for -1/2 <= x <= 1/2, to 1e-7.
inline float sine_of_half_turns(float x) {
  const float x2 = x * x;
  return x * (3.14159265f +
              x2 * (-5.16771278f +
                    x2 * (2.55016404f + x2 * (-0.599264529f + x2 * (0.0821458866f + x2 * -0.00737043095f)))));
}

/// Between 0 and 1, both left out.
inline float uniform_of(std::uint32_t random) { return (static_cast<float>(random >> 8) + 0.5f) * 0x1p-24f; }

struct NormalPair {
  float first, second;
};

/// Two independent standard normal numbers, up to 5.9 (G. E. P. Box and M. E. Muller, 1958).
inline NormalPair normals_of(RandomPair random) {
  const float radius = std::sqrt(-2 * quick_log(uniform_of(random.first)));
  const float turn = static_cast<float>(static_cast<std::int32_t>(random.second)) * 0x1p-31f;  // half turns
  const float size = std::abs(turn);
  const float folded = std::copysign(size > 0.5f ? 1 - size : size, turn);
  return {radius * sine_of_half_turns(0.5f - size), radius * sine_of_half_turns(folded)};
}

/// The Poisson number at the quantile of a standard normal number: the asymptotic expansion of M. B. Giles,
/// Algorithm 955: approximation of the inverse Poisson cumulative distribution function, ACM Trans. Math.
/// Softw. 42, 2016. `mean` must be kLeastExpandedMean or more.
inline float poisson_quantile(float mean, float normal) {
  const float root = std::sqrt(mean), per_root = 1 / root, w2 = normal * normal;
  const float expanded = mean + root * normal + (0.333333333f + w2 * 0.166666667f) -
                         per_root * normal * (0.0277777778f + w2 * 0.0138888889f) +
                         per_root * per_root * (-0.0197530864f + w2 * (0.00864197531f + w2 * 0.0037037037f));
  // Larger floats are whole numbers, and may be too large for the cast. Added back and not chosen by a
  // condition, which compilers turn into a branch.
  constexpr float kAllWhole = 0x1p23f;
  const float small = expanded < kAllWhole ? expanded : kAllWhole;
  const float positive = small > 0 ? small : 0;
  return static_cast<float>(static_cast<std::int32_t>(positive)) + (expanded - small);
}
inline constexpr float kLeastExpandedMean = 4;

}  // namespace xraycast
