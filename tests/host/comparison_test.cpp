#include "xraycast/requests/comparison.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace xraycast::comparison_test {
namespace {

constexpr int kWidth = 64, kHeight = 48;
const std::vector<std::uint8_t> kAll(kWidth* kHeight, 1);

std::vector<float> picture() {
  std::vector<float> tau(kWidth * kHeight);
  for (int j = 0; j < kHeight; ++j)
    for (int i = 0; i < kWidth; ++i)
      tau[j * kWidth + i] = static_cast<float>(1 + std::sin(0.3 * i) * std::cos(0.2 * j));
  return tau;
}

TEST(Comparison, EqualPicturesAreEqual) {
  const ImageSimilarity similarity = compare(picture(), picture(), kAll, kWidth, kHeight);
  EXPECT_EQ(similarity.psnr_db, 120);
  EXPECT_EQ(similarity.rmse, 0);
  EXPECT_NEAR(similarity.ssim, 1, 1e-12);
}

TEST(Comparison, ErrorsAreThoseOfTransmissionAndDepth) {
  const std::vector<float> a(kWidth * kHeight, 0.5f), b(kWidth * kHeight, 2.0f);
  const ImageSimilarity similarity = compare(a, b, kAll, kWidth, kHeight);
  EXPECT_NEAR(similarity.psnr_db, -20 * std::log10(std::exp(-0.5) - std::exp(-2.0)), 1e-9);
  EXPECT_NEAR(similarity.rmse, 0.75, 1e-9);
  // Flat pictures have no structure: what is left is (2 m n + C1) / (m^2 + n^2 + C1).
  const double m = 1 - std::exp(-0.5 / 2.2), n = 1 - std::exp(-2 / 2.2);
  EXPECT_NEAR(similarity.ssim, (2 * m * n + 1e-4) / (m * m + n * n + 1e-4), 1e-9);
}

TEST(Comparison, NoiseLowersTheSimilarity) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 1);
  double before = 1;
  for (const float strength : {0.02f, 0.1f, 0.5f}) {
    std::vector<float> noisy = picture();
    for (float& t : noisy) t += strength * noise(random);
    const double ssim = compare(noisy, picture(), kAll, kWidth, kHeight).ssim;
    EXPECT_LT(ssim, before);
    before = ssim;
  }
}

TEST(Comparison, LeavesOutWhatDoesNotCount) {
  std::vector<float> wrong = picture();
  std::vector<std::uint8_t> counts = kAll;
  wrong[10] = 9;
  counts[10] = 0;
  EXPECT_EQ(compare(wrong, picture(), counts, kWidth, kHeight).psnr_db, 120);
}

}  // namespace
}  // namespace xraycast::comparison_test
