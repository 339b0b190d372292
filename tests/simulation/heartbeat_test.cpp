#include "xraycast/blood_flow/heartbeat.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/contrast_agent/injection.hpp"

#include <gtest/gtest.h>

namespace xraycast::heartbeat_test {
namespace {

class Beat : public testing::TestWithParam<double> {};

TEST_P(Beat, EjectsAMeanOfOneAndRepeats) {
  const Heartbeat heart(GetParam());
  constexpr int kSteps = 10000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double flow = heart.ejection(heart.period_s() * (i + 0.5) / kSteps);
    EXPECT_GE(flow, 0);
    sum += flow;
  }
  // The midpoint rule's error with this many steps.
  EXPECT_NEAR(sum / kSteps, 1, 1e-5);
  EXPECT_NEAR(heart.ejection(7 * heart.period_s() + 0.1), heart.ejection(0.1), 1e-9);
  EXPECT_NEAR(heart.ejection(heart.period_s() - 1e-9), heart.ejection(0), 1e-6)
      << "no jump from beat to beat";
}

TEST_P(Beat, EjectsAsMuchHoweverTimeIsDivided) {
  const Heartbeat heart(GetParam());
  constexpr double kStep_s = 0.037;
  double sum = 0;
  constexpr int kSteps = 100;
  for (int i = 0; i < kSteps; ++i) sum += kStep_s * heart.mean_ejection(i * kStep_s, (i + 1) * kStep_s);
  // Rounding of differences.
  EXPECT_NEAR(sum, kSteps * kStep_s * heart.mean_ejection(0, kSteps * kStep_s), 1e-11);
  EXPECT_NEAR(heart.mean_ejection(0.05, 0.0501), heart.ejection(0.05005), 1e-3);
}

TEST_P(Beat, ContractsFromBeforeTheEjectionToAfterIt) {
  const Heartbeat heart(GetParam());
  EXPECT_GT(heart.contraction(0), 0) << "the valve opens once the ventricle has contracted";
  EXPECT_GT(heart.contraction(heart.ejection_s()), 0);
  for (int i = 0; i < 100; ++i) {
    EXPECT_GE(heart.contraction(heart.period_s() * i / 100), 0);
    EXPECT_LE(heart.contraction(heart.period_s() * i / 100), 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, Beat, testing::Values(kMinHeartRate_bpm, 50, 70, 120, kMaxHeartRate_bpm));

TEST(Heartbeat, IsSteadyWithoutAHeart) {
  EXPECT_EQ(Heartbeat(0).ejection(0.3), 1);
  EXPECT_EQ(Heartbeat(0).mean_ejection(0.3, 0.4), 1);
  EXPECT_EQ(Heartbeat(0).contraction(0.3), 0);
}

/// The ejection of a heart at rest, sampled, beginning at some phase of it.
HeartWaveform sampled(double rate_bpm, double output_ml_s, double from_share, int count = 2000) {
  const Heartbeat heart(rate_bpm);
  HeartWaveform waveform;
  for (int i = 0; i <= count; ++i) {
    const double time_s = heart.period_s() * i / count;
    waveform.samples.push_back(
        {time_s, output_ml_s * heart.ejection(time_s + from_share * heart.period_s())});
  }
  return waveform;
}

TEST(HeartWaveform, MakesTheBeatThatItWasTakenFrom) {
  for (const double bpm : {50.0, 70.0, 140.0})
    for (const double from : {0.0, 0.2, 0.6, 0.95}) {
      const HeartWaveform waveform = sampled(bpm, 70, from);
      EXPECT_NEAR(waveform.mean_ml_s(), 70, 70 * 1e-3);
      const Heartbeat heart(bpm), again(waveform);
      EXPECT_NEAR(again.period_s(), heart.period_s(), 1e-12);
      // A half sine is above a tenth of its peak but for 6 % of its length.
      EXPECT_NEAR(again.ejection_s(), heart.ejection_s(), 0.08 * heart.ejection_s());
      for (int i = 0; i < 300; ++i) {
        const double time_s = 0.01 * i, there_s = time_s + from * heart.period_s();
        // Of a mean of 1: what interpolation between 2000 samples changes of a peak of 4 at most.
        EXPECT_NEAR(again.ejection(time_s), heart.ejection(there_s), 0.02);
        EXPECT_NEAR(again.mean_ejection(time_s, time_s + 0.03), heart.mean_ejection(there_s, there_s + 0.03),
                    0.01);
        // The heart's wall is pressed for 3 % of the ejection less at both of its ends.
        EXPECT_NEAR(again.contraction(time_s), heart.contraction(there_s), 0.12);
      }
    }
}

TEST(HeartWaveform, IsReadFromLinesOfTwoNumbers) {
  const HeartWaveform commas =
      HeartWaveform::parse("time_s,flow_ml_s\r\n1,0\r\n1.2, 300\r\n1.8,-5\r\n", "h.csv");
  const HeartWaveform blanks = HeartWaveform::parse("1 0\n1.2\t300\n1.8  -5\n\n", "h.flow");
  for (const HeartWaveform* waveform : {&commas, &blanks}) {
    ASSERT_EQ(waveform->samples.size(), 3U);
    EXPECT_EQ(waveform->samples[0].time_s, 0);
    EXPECT_NEAR(waveform->samples[2].time_s, 0.8, 1e-12);
    EXPECT_EQ(waveform->samples[2].ml_s, -5);
    EXPECT_NEAR(waveform->mean_ml_s(), (0.2 * 150 + 0.6 * 147.5) / 0.8, 1e-9);
  }
}

struct BadWaveform {
  const char* text;
  const char* message;
};
class WaveformTexts : public testing::TestWithParam<BadWaveform> {};

TEST_P(WaveformTexts, AreRefusedInOneLine) {
  try {
    HeartWaveform::parse(GetParam().text, "h.csv");
    FAIL() << "nothing thrown";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), GetParam().message);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Bad, WaveformTexts,
    testing::Values(
        BadWaveform{"",
                    "h.csv: 0 samples; a heart's waveform has 2 to 100000, each a line of a time in s and a "
                    "flow in ml/s"},
        BadWaveform{"0,0\n0.5,nan\n1,0\n",
                    "h.csv: sample 2: must be a time in s and a flow of at most 5000 ml/s"},
        BadWaveform{"0,0\n0.5,3;1,0\n",
                    "h.csv: line 2: \"0.5,3;1,0\" must be a time in s and a flow in ml/s, "
                    "such as 0.12,310"},
        BadWaveform{"0;0\n0.4;300\n0.8;0\n",
                    "h.csv: line 1: \"0;0\" must be a time in s and a flow in ml/s, such as 0.12,310"},
        BadWaveform{"0,0\n0.4,1e9\n0.8,-1e9\n",
                    "h.csv: sample 2: must be a time in s and a flow of at most 5000 ml/s"},
        BadWaveform{"0,0\n0.5,300\n0.5,0\n", "h.csv: sample 3: 0.5 s; times must ascend from 0 s"},
        BadWaveform{"0,0\n500,300\n800,0\n", "h.csv: lasts for 800 s; a beat takes 0.24 to 3 s"},
        BadWaveform{"0,0\n0.5,-300\n1,0\n",
                    "h.csv: its mean is -150 ml/s; a heart gives 1 to 1000 ml/s: turn the sign"},
        BadWaveform{"0,0\n0.5,4000\n1,0\n", "h.csv: its mean is 2e+03 ml/s; a heart gives 1 to 1000 ml/s"}));

TEST(Injection, GivesItsVolumeHoweverTimeIsDivided) {
  const Injection injection{.from_s = 0.25, .to_s = 1.1, .rate_ml_s = 4};
  double ml = 0;
  constexpr double kStep_s = 0.3;
  for (int i = 0; i < 10; ++i) ml += kStep_s * injection.mean_rate_ml_s(i * kStep_s, (i + 1) * kStep_s);
  EXPECT_NEAR(ml, injection.volume_ml(), 1e-12);
}

}  // namespace
}  // namespace xraycast::heartbeat_test
