#include "xraycast/fluoroscope/subtraction.hpp"

#include "xraycast/base/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace xraycast::subtraction_test {
namespace {

constexpr int kWidth = 64, kHeight = 48;

std::vector<float> picture(const std::function<double(double x, double y)>& tau) {
  std::vector<float> values;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) values.push_back(static_cast<float>(tau(x, y)));
  return values;
}

/// A body of long waves, as a spine is.
double body(double x, double y) {
  return 3 + std::sin(2 * std::numbers::pi * x / 16) + 0.5 * std::cos(2 * std::numbers::pi * y / 12);
}

double vessel(double x, double y) { return std::abs(x - y) < 3 ? 0.2 : 0; }

TEST(Subtraction, LeavesWhatCameSinceTheMask) {
  Subtraction subtraction(kWidth, kHeight);
  std::vector<float> difference(std::size_t{kWidth} * kHeight, 7.0f);
  const std::vector<float> frame = picture([](double x, double y) { return body(x, y) + vessel(x, y); });
  subtraction.subtract(frame, difference);
  EXPECT_EQ(std::ranges::max(difference), 0) << "no mask yet";
  subtraction.add_to_mask(picture(body));
  subtraction.subtract(frame, difference);
  const std::vector<float> expected = picture(vessel);
  for (std::size_t i = 0; i < difference.size(); ++i)
    EXPECT_NEAR(difference[i], expected[i], 1e-6) << "32-bit floats of up to 5";
}

TEST(Subtraction, AMaskOfMoreFramesAddsLessNoise) {
  std::mt19937 dice(3);
  std::normal_distribution<double> noise(0, 0.1);
  const auto noisy = [&] { return picture([&](double, double) { return 2 + noise(dice); }); };
  for (const int frames : {1, 4, 16}) {
    Subtraction subtraction(kWidth, kHeight);
    for (int i = 0; i < frames; ++i) subtraction.add_to_mask(noisy());
    std::vector<float> difference(std::size_t{kWidth} * kHeight);
    double squares = 0;
    constexpr int kFrames = 10;
    for (int i = 0; i < kFrames; ++i) {
      subtraction.subtract(noisy(), difference);
      for (const float value : difference) squares += value * value;
    }
    const double variance = squares / (kFrames * kWidth * kHeight);
    // The mask's 3072 pixels are the same in all frames: their variance is known to 2.6 %.
    EXPECT_NEAR(variance, 0.01 * (1 + 1.0 / frames), 0.06 * 0.01 * (1 + 1.0 / frames)) << frames;
  }
}

TEST(Subtraction, ShiftsTheMaskByFractionsOfAPixel) {
  for (const auto& [right, down] : {std::pair{1.0, 0.0}, {0.0, -2.0}, {0.25, 0.5}, {-3.6, 1.3}}) {
    Subtraction subtraction(kWidth, kHeight);
    subtraction.add_to_mask(picture(body));
    subtraction.shift_mask({right, down});
    const std::vector<float> moved = picture([&](double x, double y) { return body(x - right, y - down); });
    std::vector<float> difference(moved.size());
    subtraction.subtract(moved, difference);
    for (int y = 8; y < kHeight - 8; ++y)
      for (int x = 8; x < kWidth - 8; ++x)
        // A cubic's error for a wave of 12 pixels, of an amplitude of 1.5.
        EXPECT_NEAR(difference[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)], 0, 0.01)
            << right << ", " << down << " at " << x << ", " << y;
  }
}

TEST(Subtraction, AShiftBackIsTheMask) {
  Subtraction subtraction(kWidth, kHeight);
  subtraction.add_to_mask(picture(body));
  subtraction.shift_mask({1e9, -1e9});
  std::vector<float> difference(std::size_t{kWidth} * kHeight);
  subtraction.subtract(picture(body), difference);
  for (const float value : difference) EXPECT_TRUE(std::isfinite(value));
  subtraction.shift_mask({});
  subtraction.subtract(picture(body), difference);
  EXPECT_EQ(std::ranges::max(difference), 0);
}

TEST(Subtraction, RefusesAMaskOfAnotherGeometry) {
  Subtraction subtraction(kWidth, kHeight);
  try {
    subtraction.add_to_mask(std::vector<float>(100), "mask.exr");
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "mask.exr: has 100 pixels, and the frames 64 x 48; take a mask of the same geometry");
  }
}

TEST(MaximumOpacification, ShowsAllThatWasFilled) {
  MaximumOpacification trace;
  EXPECT_TRUE(trace.picture().empty());
  const auto bolus_at = [](double place) {
    return picture([place](double x, double y) { return std::abs(x - place) < 4 ? vessel(x, y) : -0.01; });
  };
  for (int place = 0; place < kWidth; place += 4) trace.add(bolus_at(place));
  const std::vector<float> expected = picture(vessel);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(trace.picture()[i], expected[i], 0.011);
  trace.clear();
  EXPECT_TRUE(trace.picture().empty());
}

TEST(SubtractionPicture, ShowsContrastAgentDarkOnALightGround) {
  const std::vector<float> difference{0, 0.1f, 0.2f, 0.4f, -0.3f};
  const std::vector<std::uint8_t> rgb = subtraction_picture(difference, {.black = 0.2, .background = 0.8});
  const std::vector<int> greys{rgb[0], rgb[3], rgb[6], rgb[9], rgb[12]};
  EXPECT_EQ(greys, (std::vector<int>{204, 102, 0, 0, 255}));
  EXPECT_EQ(rgb[4], rgb[3]);
  EXPECT_EQ(rgb[5], rgb[3]);
}

TEST(SubtractionPicture, AnAutomaticWindowFitsTheVesselsAndNotTheNoise) {
  // A twentieth of the picture is vessel.
  EXPECT_NEAR(automatic_subtraction_window(picture(vessel)).black, 0.2, 1e-6);
  EXPECT_NEAR(automatic_subtraction_window(picture([](double, double) { return 1e-4; })).black, 0.01, 1e-6);
  EXPECT_NEAR(automatic_subtraction_window({}).black, 0.01, 1e-6);
}

}  // namespace
}  // namespace xraycast::subtraction_test
