#include "xraycast/display/edge_enhancement.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace xraycast::edge_enhancement_test {
namespace {

PixelPlane enhanced(const PictureSize& size, double pixel_mm, const PixelPlane& picture) {
  PixelPlane out(picture.size());
  EdgeEnhancement(size, pixel_mm).enhance(picture, out);
  return out;
}

/// Of the square about a pixel, in double precision.
double mean_about(const PictureSize& size, const PixelPlane& picture, int i, int j, int reach) {
  double sum = 0;
  for (int y = j - reach; y <= j + reach; ++y)
    for (int x = i - reach; x <= i + reach; ++x)
      sum += picture[size.row(std::clamp(y, 0, size.height - 1)) +
                     static_cast<std::size_t>(std::clamp(x, 0, size.width - 1))];
  return sum / std::pow(2 * reach + 1, 2);
}

TEST(EdgeEnhancement, IsTheDifferenceOfTwoMeans) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal(8, 0.2f);
  // Also smaller than the wider mean, and over several bands of rows.
  for (const auto& [size, pixel_mm] :
       {std::pair{PictureSize{70, 50}, 0.3}, std::pair{PictureSize{7, 5}, 0.1},
        std::pair{PictureSize{1, 1}, 0.3}, std::pair{PictureSize{33, 40}, 2.0}}) {
    PixelPlane picture(size.pixels());
    for (float& value : picture) value = normal(random);
    const PixelPlane out = enhanced(size, pixel_mm, picture);
    const int reach = EdgeEnhancement(size, pixel_mm).reach();
    for (int j = 0; j < size.height; ++j)
      for (int i = 0; i < size.width; ++i) {
        const std::size_t at = size.row(j) + static_cast<std::size_t>(i);
        const double darker = EdgeEnhancement::kMostDarker, lighter = EdgeEnhancement::kMostLighter;
        const double above = std::clamp(
            mean_about(size, picture, i, j, 1) - mean_about(size, picture, i, j, reach), -darker, lighter);
        // Of sums of 1,681 values of 8 at most in single precision.
        ASSERT_NEAR(out[at], picture[at] + EdgeEnhancement::kStrength * above, 5e-5) << i << ", " << j;
      }
  }
}

TEST(EdgeEnhancement, SpansAsMuchWhateverThePixels) {
  for (const double pixel_mm : {0.1, 0.2, 0.3, 0.45})
    EXPECT_NEAR((2 * EdgeEnhancement({640, 480}, pixel_mm).reach() + 1) * pixel_mm, 3, 0.7) << pixel_mm;
}

/// Beside steps of any height, at any angle.
TEST(EdgeEnhancement, StrongEdgesHaveNoHalos) {
  constexpr PictureSize kSize{120, 100};
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution(low, high)(random);
    };
    const double height = uniform(0.3, 3), angle = uniform(0, 6.28), pixel_mm = uniform(0.2, 0.7);
    PixelPlane step;
    for (int j = 0; j < kSize.height; ++j)
      for (int i = 0; i < kSize.width; ++i)
        step.push_back(
            static_cast<float>((i - 60) * std::cos(angle) + (j - 50) * std::sin(angle) > 0 ? height : 0.0));
    const PixelPlane out = enhanced(kSize, pixel_mm, step);
    const auto [least, most] = std::minmax_element(out.begin(), out.end());
    constexpr double kStrength = EdgeEnhancement::kStrength, kRounding = 1e-5;
    EXPECT_GE(*least, -kStrength * EdgeEnhancement::kMostDarker - kRounding) << seed;
    EXPECT_LE(*most, height + kStrength * EdgeEnhancement::kMostLighter + kRounding) << seed;
  }
}

/// A wire of 0.36 mm, and a catheter of 5 F, of little contrast, at any angle in noise as a detector blurs
/// it: the middle's contrast over a pixel's noise, after and before.
TEST(EdgeEnhancement, InstrumentsKeepTheirContrastToNoise) {
  constexpr PictureSize kSize{160, 160};
  for (const double width_mm : {0.36, 1.67})
    for (const double pixel_mm : {0.15, 0.2, 0.28, 0.36, 0.45}) {
      double contrast = 0, contrast_before = 0, noise = 0, noise_before = 0;
      for (std::uint32_t seed = 0; seed < 8; ++seed) {
        std::mt19937 random(seed);
        std::normal_distribution<double> normal(0, 0.04);
        const double angle = std::uniform_real_distribution(0.0, 6.28)(random);
        std::vector<double> white(kSize.pixels());
        for (double& value : white) value = normal(random);
        const auto blurred_noise = [&](int i, int j) {
          const auto at = [&](int x, int y) {
            return white[kSize.row((y + kSize.height) % kSize.height) +
                         static_cast<std::size_t>((x + kSize.width) % kSize.width)];
          };
          return 0.6 * at(i, j) + 0.1 * (at(i - 1, j) + at(i + 1, j) + at(i, j - 1) + at(i, j + 1));
        };
        const auto off_mm = [&](int i, int j) {
          return pixel_mm * std::abs((i - 79.5) * std::cos(angle) + (j - 79.5) * std::sin(angle));
        };
        PixelPlane with, without;
        for (int j = 0; j < kSize.height; ++j)
          for (int i = 0; i < kSize.width; ++i) {
            const double still = 8 + blurred_noise(i, j);
            const double covered =
                std::clamp((0.5 * width_mm - off_mm(i, j)) / pixel_mm + 0.5, 0.0, width_mm / pixel_mm);
            without.push_back(static_cast<float>(still));
            with.push_back(static_cast<float>(still - 0.08 * std::min(covered, 1.0)));
          }
        const PixelPlane shown_with = enhanced(kSize, pixel_mm, with),
                         shown_without = enhanced(kSize, pixel_mm, without);
        for (int j = 20; j < 140; ++j)
          for (int i = 20; i < 140; ++i) {
            const std::size_t at = kSize.row(j) + static_cast<std::size_t>(i);
            noise += std::pow(shown_without[at] - 8, 2);
            noise_before += std::pow(without[at] - 8, 2);
            if (off_mm(i, j) > 0.5 * std::max(0.5 * width_mm, pixel_mm)) continue;
            contrast += shown_without[at] - shown_with[at];
            contrast_before += without[at] - with[at];
          }
      }
      EXPECT_GT(contrast / contrast_before / std::sqrt(noise / noise_before), 0.95)
          << width_mm << " mm, pixels of " << pixel_mm << " mm";
    }
}

}  // namespace
}  // namespace xraycast::edge_enhancement_test
