#include "xraycast/base/metal_depth.hpp"

#include "xraycast/base/image.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

namespace xraycast::metal_depth_test {
namespace {

constexpr int kSide = 160;  // pixels of 3 mm
constexpr double kPixel_mm = 3, kWater_per_mm = 0.02;

/// A body's optical depths by seeds, and the same with a metal ball and a rod below it.
struct Body {
  std::vector<float> anatomy, with_metal;
  double share = 0;  ///< of the body's pixels that metal is in
};

double chord_mm(double radius_mm, double off_mm) {
  return 2 * std::sqrt(std::max(0.0, radius_mm * radius_mm - off_mm * off_mm));
}

Body body(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  const double half_mm = uniform(90, 200), thick_mm = uniform(150, 320), lung = uniform(0, 0.5),
               spine_mm = uniform(15, 25), bone_per_mm = uniform(0.01, 0.025), off_mm = uniform(-60, 60);
  const double hu = uniform(4000, 30000), metal_per_mm = kWater_per_mm * hu / 1000, ball_mm = uniform(10, 26),
               rod_mm = uniform(5, 12), x_mm = uniform(-80, 80), z_mm = uniform(-120, 60);
  Body made;
  double covered = 0, all = 0;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      const double x = (i - kSide / 2 + 0.5) * kPixel_mm, z = (j - kSide / 2 + 0.5) * kPixel_mm;
      const double inside = std::max(0.0, 1 - std::pow(x / half_mm, 2));
      double tau = kWater_per_mm * thick_mm * std::sqrt(inside);
      for (const double side : {-0.5, 0.5})
        tau *= 1 - lung * std::clamp(1.5 - std::hypot(x - side * half_mm, 0.5 * (z + 100)) / (0.3 * half_mm),
                                     0.0, 1.0);
      if (inside > 0) tau += bone_per_mm * chord_mm(spine_mm, x - off_mm);
      const double ball = chord_mm(ball_mm, std::hypot(x - x_mm, z - z_mm)),
                   rod = z > z_mm && z < z_mm + 120 ? chord_mm(rod_mm, x - x_mm) : 0,
                   metal = metal_per_mm * std::max(ball, rod);
      made.anatomy.push_back(static_cast<float>(tau));
      made.with_metal.push_back(static_cast<float>(tau + metal));
      all += tau > 0.05 ? 1 : 0;
      covered += metal > 0.5 ? 1 : 0;
    }
  made.share = covered / all;
  return made;
}

/// Between two depths, in shares of the way from black to white.
double contrast(const GreyWindow& window, double tau, double more) {
  return window.grey(tau) - window.grey(tau + more);
}

std::optional<float> metal_depth(const std::vector<float>& depths) {
  DepthCounts counts;
  for (const float depth : depths) counts.add(depth);
  return counts.metal_from();
}

TEST(MetalDepth, IsNoneInBodiesWithoutMetal) {
  for (std::uint32_t seed = 1; seed <= 200; ++seed) EXPECT_FALSE(metal_depth(body(seed).anatomy)) << seed;
  EXPECT_FALSE(metal_depth({}));
  EXPECT_FALSE(metal_depth(std::vector<float>(100, 3.0f)));
}

TEST(MetalDepth, LeavesTheWindowAsItWasWithoutMetal) {
  int found = 0;
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    const Body made = body(seed);
    const GreyWindow without = automatic_window(made.anatomy), with = automatic_window(made.with_metal);
    found += metal_depth(made.with_metal).has_value();
    const double typical = typical_depth(made.anatomy);
    const double ratio = contrast(with, 0.8 * typical, 0.2) / contrast(without, 0.8 * typical, 0.2);
    // What metal of some 3 cm hides, and its edges of less than a pixel, move the ends of the range a little;
    // thin metal that adds less than 1.5 stays in it.
    EXPECT_GT(ratio, 0.7) << seed << ": " << made.share;
    EXPECT_LT(ratio, 1.1) << seed << ": " << made.share;
  }
  EXPECT_GT(found, 180);
}

}  // namespace
}  // namespace xraycast::metal_depth_test
