#include "xraycast/serving/live_body.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

namespace xraycast::live_body_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::shared_ptr<const Displacement> shift(double z_mm) {
  return affine_displacement(glm::dmat3(1), {0, 0, z_mm});
}

/// A breath of 4 s and a beat of 0.8 s.
BodyRequest breath_and_heart() {
  MotionMode breath{"breath", 4, {}, {{0, nullptr}, {1, shift(12)}}};
  MotionMode heart{"heart", 0.8, {}, {{0, nullptr}, {0.4, shift(3)}}};
  return {.motion = std::make_shared<const Motion>(std::vector{breath, heart}, "motion.json")};
}

// Phases come from times by a division or a cosine.
constexpr double kRounding = 1e-9;

TEST(LiveBody, GoesOnUnlessItIsHeld) {
  LiveBody body(breath_and_heart());
  body.advance(0.2);
  EXPECT_NEAR(body.modes()[1].phase, 0.25, kRounding);
  body.toggle_hold("breath");
  const double breath = body.modes()[0].phase;
  EXPECT_TRUE(body.modes()[0].is_held);
  body.advance(0.2);
  EXPECT_EQ(body.modes()[0].phase, breath);
  EXPECT_NEAR(body.modes()[1].phase, 0.5, kRounding);
  body.change(parse_body_changes("speed 2"));
  body.change(parse_body_changes("release breath"));
  body.change(parse_body_changes("hold heart 0.125"));
  body.advance(0.1);
  EXPECT_NEAR(body.modes()[0].phase, 0.5 * (1 - std::cos(0.5 * 3.14159265358979 * 0.4)), 1e-9);
  EXPECT_NEAR(body.modes()[1].phase, 0.125, kRounding);
}

TEST(LiveBody, ExposesAtOnceWithoutAGate) {
  LiveBody body(breath_and_heart());
  body.advance(0.3);
  EXPECT_NEAR(body.exposure_s(0).value(), 0.3, kRounding);
  EXPECT_TRUE(body.opens_again());
}

TEST(LiveBody, ExposesOnceWhenTheGateHasOpened) {
  LiveBody body(breath_and_heart());
  body.change(parse_body_changes("gate heart 0.5"));
  std::vector<double> exposures_s;
  for (int frame = 0; frame < 100; ++frame) {
    body.advance(1.0 / 30);
    if (const auto at_s = body.exposure_s(0)) exposures_s.push_back(*at_s);
  }
  ASSERT_EQ(exposures_s.size(), 4);  // at 0.4 s and each 0.8 s later, of 3.33 s
  for (std::size_t i = 0; i < exposures_s.size(); ++i)
    EXPECT_NEAR(exposures_s[i], 0.4 + 0.8 * static_cast<double>(i), 1e-7);
  for (const double at_s : exposures_s) EXPECT_NEAR(body.phases_at(at_s)[1], 0.5, 1e-6);
  body.change(parse_body_changes("gate off"));
  EXPECT_TRUE(body.exposure_s(0));
}

TEST(LiveBody, WaitsForAGateThatIsAboutToOpen) {
  LiveBody body(breath_and_heart());
  body.change(parse_body_changes("gate heart 0.5"));
  body.advance(0.39);
  std::atomic<bool> ends{false};
  std::thread clock([&] {
    while (!ends) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      body.advance(0.001);
    }
  });
  const auto at_s = body.exposure_s(0.04);
  const double seen_s = body.time_s();
  ends = true;
  clock.join();
  ASSERT_TRUE(at_s);
  EXPECT_NEAR(*at_s, 0.4, 1e-7);
  EXPECT_GE(seen_s, 0.4);
  EXPECT_LT(seen_s, 0.42);  // some steps of a loaded machine
}

TEST(LiveBody, HasAGateThatNeverOpensWhileItsModeIsHeldElsewhere) {
  LiveBody body(breath_and_heart());
  body.change(parse_body_changes("gate heart 0.5"));
  body.change(parse_body_changes("hold heart 0.25"));
  EXPECT_FALSE(body.opens_again());
  for (int frame = 0; frame < 60; ++frame) {
    body.advance(1.0 / 30);
    EXPECT_FALSE(body.exposure_s(0));
  }
  body.change(parse_body_changes("hold heart 0.5"));
  body.advance(0.01);
  EXPECT_TRUE(body.exposure_s(0)) << "it is held where the gate is open";
  body.advance(0.01);
  EXPECT_TRUE(body.exposure_s(0));
}

TEST(LiveBody, TracesWhatHasPassed) {
  LiveBody body(breath_and_heart());
  for (int frame = 0; frame < 300; ++frame) {
    body.advance(1.0 / 30);
    body.traces();
  }
  body.mark_exposure(9.5);
  const BodyTraces& traces = body.traces();
  EXPECT_NEAR(traces.end_s, 10, 0.0051);
  EXPECT_EQ(traces.count, 2000 - (traces.end_s < 10 - 1e-9 ? 1 : 0));
  ASSERT_EQ(traces.samples.size(), 2);
  EXPECT_THAT(traces.exposures_s, ElementsAre(9.5));
  for (std::size_t i = 0; i < traces.samples[1].size(); ++i) {
    const double time_s = traces.end_s - 0.005 * static_cast<double>(traces.samples[1].size() - 1 - i);
    EXPECT_NEAR(traces.samples[1][i], ecg(time_s / 0.8), 1e-5) << time_s;  // floats
  }
  EXPECT_EQ(traces.samples[1].size(), 1200) << "six seconds";
}

TEST(LiveBody, ForgetsOldExposuresWithoutAMonitor) {
  LiveBody body(breath_and_heart());
  for (int pulse = 0; pulse < 600; ++pulse) {
    body.advance(1.0 / 15);
    body.mark_exposure(body.time_s());
  }
  EXPECT_EQ(body.traces().exposures_s.size(), 15 * 6) << "those of six seconds";
}

TEST(LiveBody, TracesAHoldFromWhereItBegan) {
  LiveBody body(breath_and_heart());
  body.advance(0.4);
  body.change(parse_body_changes("hold breath"));
  body.advance(0.4);
  const auto& samples = body.traces().samples[0];
  EXPECT_NEAR(samples[20], 0.5 * (1 - std::cos(0.5 * 3.14159265358979 * 0.105)), 1e-5);
  EXPECT_EQ(samples.back(), samples[100]);
}

TEST(BodyChanges, AreWordsOrAreRefused) {
  for (const char* text :
       {"", "hold", "hold breath now", "hold a 0.5 1", "release", "release breath 1", "speed", "speed fast",
        "gate", "gate heart", "gate on", "gate heart late", "dance"})
    EXPECT_THROW(parse_body_changes(text), InputError) << text;
  LiveBody body(breath_and_heart());
  for (const char* text : {"hold cough", "release cough", "hold heart 2", "speed -1", "speed nan",
                           "gate cough 0", "gate heart 1.5"})
    EXPECT_THROW(body.change(parse_body_changes(text)), InputError) << text;
  EXPECT_FALSE(body.gate());
  EXPECT_EQ(body.speed(), 1);
}

TEST(BodyChanges, AddUp) {
  BodyChanges changes = parse_body_changes("hold breath");
  changes.add(parse_body_changes("hold heart 0.5"));
  changes.add(parse_body_changes("release breath"));
  changes.add(parse_body_changes("gate heart 0.75"));
  changes.add(parse_body_changes("gate off"));
  EXPECT_FALSE(changes.holds.at("breath").is_held);
  EXPECT_EQ(changes.holds.at("heart").phase, 0.5);
  ASSERT_TRUE(changes.gate);
  EXPECT_FALSE(*changes.gate);
}

TEST(LiveBody, NeedsAMotion) {
  EXPECT_THAT([] { LiveBody body(BodyRequest{}); },
              ThrowsMessage<InputError>(HasSubstr("the body is still")));
}

}  // namespace
}  // namespace xraycast::live_body_test
