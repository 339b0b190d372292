#include "xraycast/blood_flow/heartbeat.hpp"

#include "xraycast/simulation/injection.hpp"

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

TEST(Injection, GivesItsVolumeHoweverTimeIsDivided) {
  const Injection injection{.from_s = 0.25, .to_s = 1.1, .rate_ml_s = 4};
  double ml = 0;
  constexpr double kStep_s = 0.3;
  for (int i = 0; i < 10; ++i) ml += kStep_s * injection.mean_rate_ml_s(i * kStep_s, (i + 1) * kStep_s);
  EXPECT_NEAR(ml, injection.volume_ml(), 1e-12);
}

}  // namespace
}  // namespace xraycast::heartbeat_test
