#include "xraycast/motion/body_request.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::body_request_test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Phases come from times by a division or a cosine.
constexpr double kRounding = 1e-9;

std::shared_ptr<const Displacement> shift(double z_mm) {
  return affine_displacement(glm::dmat3(1), {0, 0, z_mm});
}

/// A breath there and back in 4 s to a phase of 0.8, and a beat in 0.8 s.
std::shared_ptr<const Motion> breath_and_heart() {
  MotionMode breath{"breath", 0, {{0, 0}, {2, 0.8}, {4, 0}}, {{0, nullptr}, {1, shift(12)}}};
  MotionMode heart{"heart", 0.8, {}, {{0, nullptr}, {0.4, shift(3)}}};
  return std::make_shared<const Motion>(std::vector{breath, heart}, "motion.json");
}

std::string refusal_of(const BodyRequest& request) {
  try {
    check(request);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(BodyRequest, TakesModesToTheirPhasesByItsSpeedUnlessTheyAreHeld) {
  const BodyRequest request{.motion = breath_and_heart(), .phase = {{"breath", 0.9}}, .speed = 2};
  EXPECT_THAT(phases_at(request, 0.3), ElementsAre(0.9, DoubleNear(0.75, kRounding)));
  EXPECT_THAT(phases_at({}, 0.3), ElementsAre());
}

TEST(BodyRequest, GivesTheSamePhasesByAClockThatCanBeChanged) {
  const BodyRequest request{.motion = breath_and_heart(), .phase = {{"breath", 0.5}}, .speed = 3};
  BodyClock clock = clock_of(request);
  for (int i = 0; i < 50; ++i) {
    clock.advance(0.037);
    const std::vector<double> phases = phases_at(request, clock.time_s()), told = clock.phases();
    for (std::size_t m = 0; m < phases.size(); ++m) EXPECT_NEAR(phases[m], told[m], kRounding) << i;
  }
  EXPECT_TRUE(clock.is_held("breath"));
  clock.release("breath");
  clock.advance(0.1);
  EXPECT_GT(std::abs(clock.phases()[0] - 0.5), 0.01);
}

TEST(BodyRequest, ExposesWhenTheGateOpens) {
  BodyRequest request{.motion = breath_and_heart(), .gate = PhaseGate{"heart", 0.75}};
  EXPECT_NEAR(exposure_time_s(request, 0), 0.6, kRounding);
  EXPECT_NEAR(exposure_time_s(request, 0.61), 1.4, kRounding);
  request.speed = 2;
  EXPECT_NEAR(exposure_time_s(request, 0), 0.3, kRounding);
  EXPECT_NEAR(exposure_time_s(request, 0.31), 0.7, kRounding);
  for (double due_s = 0; due_s < 3; due_s += 0.17) {
    const double heart = phases_at(request, exposure_time_s(request, due_s))[1];
    EXPECT_NEAR(heart, 0.75, 1e-6) << due_s;  // a phase lasts 0.4 s: of the time's rounding
  }
  request.gate.reset();
  EXPECT_EQ(exposure_time_s(request, 0.61), 0.61);
}

TEST(BodyRequest, RefusesWhatABodyCannotDo) {
  const auto motion = breath_and_heart();
  EXPECT_EQ(refusal_of({.motion = motion, .phase = {{"breath", 1}}, .speed = 0}), "");
  EXPECT_EQ(refusal_of({.motion = motion, .phase = {{"heart", 1}}, .gate = PhaseGate{"heart", 0}}), "");
  const std::vector<std::pair<BodyRequest, std::string>> refused{
      {{.phase = {{"breath", 1}}}, "`phase` needs a motion"},
      {{.speed = 2}, "`motion_speed` needs a motion"},
      {{.gate = PhaseGate{"heart", 0.5}}, "`gate` needs a motion"},
      {{.motion = motion, .phase = {{"cough", 1}}}, "cough"},
      {{.motion = motion, .speed = -1}, "`motion_speed` -1: must be 0 to 100"},
      {{.motion = motion, .speed = std::nan("")}, "`motion_speed` nan"},
      {{.motion = motion, .gate = PhaseGate{"cough", 0.5}}, "no such mode; choose one of breath, heart"},
      {{.motion = motion, .gate = PhaseGate{"heart", 1.5}}, "must be 0 to 1"},
      {{.motion = motion, .gate = PhaseGate{"breath", 0.9}}, "breath never has this phase"},
      {{.motion = motion, .phase = {{"heart", 0.2}}, .gate = PhaseGate{"heart", 0.5}}, "never has this"},
      {{.motion = motion, .speed = 0, .gate = PhaseGate{"heart", 0.5}}, "never has this"}};
  for (const auto& [request, why] : refused) EXPECT_THAT(refusal_of(request), HasSubstr(why));
}

TEST(PhaseGate, IsAModeAndItsPhase) {
  EXPECT_EQ(parse_gate("heart=0.75"), (PhaseGate{"heart", 0.75}));
  for (const char* text : {"heart", "=0.5", "heart=", "heart=late", "heart=0.5s"})
    EXPECT_THROW(parse_gate(text), InputError) << text;
}

}  // namespace
}  // namespace xraycast::body_request_test
