#include "xraycast/simulation/cardiac_waveform.hpp"

#include "xraycast/simulation/injection.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace xraycast::cardiac_waveform_test {
namespace {

class Beat : public testing::TestWithParam<double> {};

TEST_P(Beat, HasAMeanOfOneAndRepeats) {
  const CardiacWaveform wave(GetParam());
  const double period_s = 60 / GetParam();
  constexpr int kSteps = 10000;
  double sum = 0, largest = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double flow = wave.at(period_s * (i + 0.5) / kSteps);
    EXPECT_GT(flow, 0);
    sum += flow;
    largest = std::max(largest, flow);
  }
  // The midpoint rule's error with this many steps.
  EXPECT_NEAR(sum / kSteps, 1, 1e-5);
  // The peak is looked for at a thousand phases; near it the wave is flat.
  EXPECT_NEAR(wave.peak(), largest, 1e-4);
  EXPECT_NEAR(wave.at(7 * period_s + 0.1), wave.at(0.1), 1e-9);
  EXPECT_NEAR(wave.at(period_s - 1e-9), wave.at(0), 1e-6) << "no jump from beat to beat";
}

INSTANTIATE_TEST_SUITE_P(Rates, Beat, testing::Values(kMinHeartRate_bpm, 50, 70, 120, kMaxHeartRate_bpm));

TEST(CardiacWaveform, HasTheResistiveIndexOfARenalArtery) {
  const CardiacWaveform wave(70);
  const double end_diastole = wave.at(60.0 / 70 - 1e-6);
  // 0.6 +- 0.05 in normal kidneys.
  EXPECT_NEAR((wave.peak() - end_diastole) / wave.peak(), 0.6, 0.05);
}

TEST(CardiacWaveform, IsSteadyWithoutAHeart) {
  EXPECT_EQ(CardiacWaveform(0).at(0.3), 1);
  EXPECT_EQ(CardiacWaveform(0).peak(), 1);
}

TEST(Injection, GivesItsVolumeHoweverTimeIsDivided) {
  const Injection injection{.from_s = 0.25, .to_s = 1.1, .rate_ml_s = 4};
  double ml = 0;
  constexpr double kStep_s = 0.3;
  for (int i = 0; i < 10; ++i) ml += kStep_s * injection.mean_rate_ml_s(i * kStep_s, (i + 1) * kStep_s);
  EXPECT_NEAR(ml, injection.volume_ml(), 1e-12);
}

}  // namespace
}  // namespace xraycast::cardiac_waveform_test
