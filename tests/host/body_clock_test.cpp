#include "xraycast/motion/body_clock.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <optional>

namespace xraycast::body_clock_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Phases come from times by a division, a cosine or a cubic.
constexpr double kRounding = 1e-9;

std::shared_ptr<const Displacement> shift(double z_mm) {
  return affine_displacement(glm::dmat3(1), {0, 0, z_mm});
}

/// There and back in 4 s.
MotionMode breath() { return {"breath", 4, {}, {{0, nullptr}, {1, shift(12)}}}; }

/// A beat in 0.8 s.
MotionMode heart() { return {"heart", 0.8, {}, {{0, nullptr}, {0.4, shift(3)}}}; }

/// In for 1.5 s, out for 1.5 s and at rest for 1 s, to a phase of 0.8.
MotionMode resting_breath() {
  MotionMode mode = breath();
  mode.period_s = 0;
  mode.waveform = {{0, 0}, {1.5, 0.8}, {3, 0}, {4, 0}};
  return mode;
}

/// R waves after 0.8, 0.9 and 0.7 s.
MotionMode irregular_heart() {
  MotionMode mode = heart();
  mode.period_s = 0;
  mode.waveform = {{0, 0}, {0.8, 1}, {1.7, 2}, {2.4, 3}};
  return mode;
}

BodyClock clock_of(std::vector<MotionMode> modes, double start_s = 0) {
  return BodyClock(Motion(std::move(modes), "motion.json"), start_s);
}

double breath_at(double time_s) { return 0.5 * (1 - std::cos(0.5 * std::numbers::pi * time_s)); }

// ---- time ----------------------------------------------------------------------------------------------

TEST(BodyClock, StartsAtATimeOfTheMotion) {
  const BodyClock clock = clock_of({breath(), heart()}, 1.0);
  EXPECT_EQ(clock.time_s(), 1.0);
  EXPECT_THAT(clock.names(), ElementsAre("breath", "heart"));
  const std::vector<double> phases = clock.phases();
  ASSERT_EQ(phases.size(), 2U);
  EXPECT_NEAR(phases[0], 0.5, kRounding);
  EXPECT_NEAR(phases[1], 0.25, kRounding);
}

TEST(BodyClock, FollowsTheMotionWhileNobodyInterferes) {
  const Motion motion({resting_breath(), irregular_heart()}, "motion.json");
  BodyClock clock(motion);
  for (int step = 0; step < 1000; ++step) {
    const std::vector<double> phases = clock.phases(), expected = motion.phases_at(clock.time_s());
    for (std::size_t m = 0; m < phases.size(); ++m) EXPECT_NEAR(phases[m], expected[m], 1e-6) << step;
    clock.advance(0.0371);
  }
}

TEST(BodyClock, WrapsAfterManyBeats) {
  BodyClock clock = clock_of({heart()});
  clock.advance(1000 * 0.8 + 0.2);
  EXPECT_NEAR(clock.phases()[0], 0.25, kRounding);
}

// ---- hold ----------------------------------------------------------------------------------------------

TEST(BodyClock, HoldsAModeWhileTheOthersGoOn) {
  BodyClock clock = clock_of({breath(), heart()});
  clock.advance(0.6);
  clock.hold("breath");
  clock.advance(10.0);
  EXPECT_TRUE(clock.is_held("breath"));
  EXPECT_FALSE(clock.is_held("heart"));
  EXPECT_NEAR(clock.phases()[0], breath_at(0.6), kRounding);
  EXPECT_NEAR(clock.phases()[1], 0.25, kRounding);
}

TEST(BodyClock, GoesOnWithoutAJumpWhenReleased) {
  BodyClock clock = clock_of({breath()});
  clock.advance(0.6);
  clock.hold("breath");
  clock.advance(7.3);
  clock.release("breath");
  EXPECT_NEAR(clock.phases()[0], breath_at(0.6), kRounding);
  clock.advance(0.5);
  EXPECT_NEAR(clock.phases()[0], breath_at(1.1), kRounding);
}

TEST(BodyClock, HoldsAtAPhaseAndGoesOnFromThere) {
  BodyClock clock = clock_of({breath()}, 0.3);
  clock.hold("breath", 0.5);  // which it would have at 1 s, on the way in
  EXPECT_NEAR(clock.phases()[0], 0.5, kRounding);
  clock.advance(20.0);
  EXPECT_NEAR(clock.phases()[0], 0.5, kRounding);
  clock.release("breath");
  clock.advance(0.4);
  EXPECT_NEAR(clock.phases()[0], breath_at(1.4), kRounding);
}

TEST(BodyClock, HoldsOnTheWayThatItIsOn) {
  BodyClock clock = clock_of({breath()}, 2.5);
  clock.hold("breath", 0.5);  // at 3 s, on the way out
  clock.release("breath");
  clock.advance(0.4);
  EXPECT_NEAR(clock.phases()[0], breath_at(3.4), kRounding);
}

TEST(BodyClock, HoldsAtThePhaseThatItHasWithoutGoingOnByACycle) {
  BodyClock clock = clock_of({breath()}, 0.7);
  clock.hold("breath", clock.phases()[0]);
  clock.release("breath");
  clock.advance(0.1);
  EXPECT_NEAR(clock.phases()[0], breath_at(0.8), 1e-6);
}

TEST(BodyClock, RefusesToHoldAtAPhaseThatAWaveformNeverHas) {
  BodyClock clock = clock_of({resting_breath()}, 0.5);
  const double before = clock.phases()[0];
  try {
    clock.hold("breath", 0.9);
    FAIL() << "it rises to 0.8 only";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("`phase` breath=0.9"));
  }
  EXPECT_FALSE(clock.is_held("breath"));
  EXPECT_EQ(clock.phases()[0], before);
}

// ---- speed ---------------------------------------------------------------------------------------------

TEST(BodyClock, SpeedsUpFromThePhaseThatAModeHas) {
  BodyClock clock = clock_of({breath(), heart()});
  clock.advance(0.6);
  clock.set_speed("breath", 2);
  EXPECT_NEAR(clock.phases()[0], breath_at(0.6), kRounding);
  clock.advance(0.2);
  EXPECT_NEAR(clock.phases()[0], breath_at(1.0), kRounding);
  EXPECT_NEAR(clock.phases()[1], 0.0, kRounding);
  clock.set_speed(0.5);
  clock.advance(0.4);
  EXPECT_NEAR(clock.phases()[0], breath_at(1.2), kRounding);
  EXPECT_NEAR(clock.phases()[1], 0.25, kRounding);
}

TEST(BodyClock, TellsPhasesOfOtherTimesAtTheSpeedsOfNow) {
  BodyClock clock = clock_of({breath(), heart()}, 2);
  clock.set_speed("breath", 3);
  clock.hold("heart");
  const std::vector<double> later = clock.phases_at(2.5), before = clock.phases_at(1.9);
  EXPECT_NEAR(later[0], breath_at(3.5), kRounding);
  EXPECT_NEAR(before[0], breath_at(1.7), kRounding);
  EXPECT_NEAR(later[1], 0.5, kRounding);
  EXPECT_NEAR(before[1], 0.5, kRounding);
}

// ---- gates ---------------------------------------------------------------------------------------------

TEST(BodyClock, OpensAGateOncePerBeat) {
  const BodyClock clock = clock_of({heart()});
  EXPECT_NEAR(clock.next_instant("heart", 0.75, 0).value(), 0.6, kRounding);
  EXPECT_NEAR(clock.next_instant("heart", 0.75, 0.61).value(), 1.4, kRounding);
  EXPECT_NEAR(clock.next_instant("heart", 0, 0.1).value(), 0.8, kRounding);
  EXPECT_NEAR(clock.next_instant("heart", 1, 0.1).value(), 0.8, kRounding);
}

TEST(BodyClock, OpensAGateOfABreathOnTheWayInAndOut) {
  const BodyClock clock = clock_of({breath()});
  EXPECT_NEAR(clock.next_instant("breath", 0.5, 0).value(), 1, kRounding);
  EXPECT_NEAR(clock.next_instant("breath", 0.5, 1.1).value(), 3, kRounding);
  EXPECT_NEAR(clock.next_instant("breath", 0.5, 3.1).value(), 5, kRounding);
  EXPECT_NEAR(clock.next_instant("breath", 1, 3.1).value(), 6, kRounding);
}

TEST(BodyClock, OpensGatesOfAnIrregularRhythm) {
  const BodyClock clock = clock_of({irregular_heart()});
  double at_s = 0;
  for (const double r_wave_s : {0.8, 1.7, 2.4, 3.2, 4.1, 4.8, 5.6}) {
    at_s = clock.next_instant("heart", 0, at_s + 0.1).value();
    EXPECT_NEAR(at_s, r_wave_s, kRounding);
  }
  for (int beat = 0; beat < 20; ++beat) {
    const double next_s = clock.next_instant("heart", 0.75, at_s + 0.001).value();
    EXPECT_NEAR(clock.phases_at(next_s)[0], 0.75, kRounding);
    EXPECT_GT(next_s, at_s);
    EXPECT_LT(next_s, at_s + 1.7);  // two of the longest beats, less the first gate's distance
    at_s = next_s;
  }
}

TEST(BodyClock, FindsABreathAtRestAtOnce) {
  const BodyClock clock = clock_of({resting_breath()});
  EXPECT_NEAR(clock.next_instant("breath", 0, 0.5).value(), 3, kRounding);
  EXPECT_NEAR(clock.next_instant("breath", 0, 3.4).value(), 3.4, kRounding);
  EXPECT_NEAR(clock.next_instant("breath", 0, 4.2).value(), 7, kRounding);
  EXPECT_FALSE(clock.next_instant("breath", 0.9, 0).has_value());
}

RC_GTEST_PROP(BodyClock, FindsTheFirstOfAllInstants, ()) {
  const bool is_heart = *rc::gen::arbitrary<bool>();
  MotionMode mode = is_heart ? heart() : breath();
  mode.period_s = 0;
  mode.waveform = {{-0.4, 0}};
  for (int sample = *rc::gen::inRange(1, 7); sample > 0; --sample) {
    const double after_s = 0.01 * *rc::gen::inRange(5, 150), share = 0.01 * *rc::gen::inRange(0, 101);
    mode.waveform.push_back(
        {mode.waveform.back().time_s + after_s, is_heart ? mode.waveform.back().phase + share : share});
  }
  mode.waveform.push_back(
      {mode.waveform.back().time_s + 0.5, is_heart ? std::ceil(mode.waveform.back().phase) : 0});
  // Between the phases of all samples, so that none is touched at an extreme.
  const double phase = 0.005 + 0.01 * *rc::gen::inRange(0, 99), from_s = 0.01 * *rc::gen::inRange(-500, 500);
  const BodyClock clock = clock_of({mode}, from_s);
  // A step in which the phase changes by 0.1 at most, for it rises by 1 in 0.05 s or more.
  constexpr double kStep_s = 5e-4, kFar = 0.25;
  const auto away_at = [&](double time_s) {
    const double away = mode.phase_at(time_s) - phase;
    return is_heart ? away - std::round(away) : away;
  };
  std::optional<double> first_s;
  const double until_s = from_s + mode.waveform.back().time_s - mode.waveform.front().time_s + kStep_s;
  for (double time_s = from_s; time_s < until_s && !first_s; time_s += kStep_s) {
    const double here = away_at(time_s), next = away_at(time_s + kStep_s);
    if (here * next <= 0 && std::abs(here) < kFar && std::abs(next) < kFar) first_s = time_s;
  }
  const std::optional<double> found_s = clock.next_instant(mode.name, phase, from_s);
  RC_ASSERT(found_s.has_value() == first_s.has_value());
  if (found_s) RC_ASSERT(std::abs(*found_s - *first_s) <= 2 * kStep_s);
}

TEST(BodyClock, OpensGatesAtTheSpeedOfNow) {
  BodyClock clock = clock_of({heart()}, 0.2);
  clock.set_speed("heart", 0.5);
  EXPECT_NEAR(clock.next_instant("heart", 0.75, 0.2).value(), 1.0, kRounding);
  EXPECT_NEAR(clock.next_instant("heart", 0.75, 1.1).value(), 2.6, kRounding);
}

TEST(BodyClock, CountsTheInstantAtWhichItIs) {
  BodyClock clock = clock_of({irregular_heart(), breath()}, 0.123);
  for (int beat = 0; beat < 50; ++beat) {
    const double gate_s = clock.next_instant("heart", 0.3, clock.time_s() + 0.01).value();
    clock.advance(gate_s - clock.time_s());
    EXPECT_NEAR(clock.next_instant("heart", 0.3, clock.time_s()).value(), gate_s, 2e-9) << beat;
  }
}

TEST(BodyClock, HoldsAGateOpenOrShut) {
  BodyClock clock = clock_of({heart()});
  clock.hold("heart", 0.75);
  EXPECT_EQ(clock.next_instant("heart", 0.75, 5), 5);
  EXPECT_FALSE(clock.next_instant("heart", 0.5, 5).has_value());
  clock.hold("heart", 1);
  EXPECT_EQ(clock.next_instant("heart", 0, 5), 5);
}

// ---- traces --------------------------------------------------------------------------------------------

TEST(BodyClock, TracesTheEcgAndTheBreath) {
  const BodyClock clock = clock_of({breath(), heart()});
  const std::vector<double> traces = clock.traces_at(0.8);
  EXPECT_NEAR(traces[0], breath_at(0.8), kRounding);
  EXPECT_EQ(traces[1], ecg(clock.phases_at(0.8)[1]));
  EXPECT_NEAR(traces[1], 1, 1e-3);  // the tails of Q and S move the peak a little
  EXPECT_NEAR(clock.traces_at(1.0)[1], ecg(0.25), kRounding);
}

TEST(Ecg, HasTheWavesOfTheModelInOrder) {
  std::vector<double> peaks, valleys;
  for (int i = -400; i < 400; ++i) {
    const double phase = 0.00125 * i, here = ecg(phase);
    if (here > ecg(phase - 0.00125) && here > ecg(phase + 0.00125)) peaks.push_back(phase);
    if (here < ecg(phase - 0.00125) && here < ecg(phase + 0.00125)) valleys.push_back(phase);
  }
  // P, R and T; between them Q and S. A peak may move by a sixtieth of the beat under its neighbours' tails.
  ASSERT_EQ(peaks.size(), 3U);
  EXPECT_NEAR(peaks[0], -1 / 6.0, 1 / 60.0);
  EXPECT_NEAR(peaks[1], 0, 1 / 60.0);
  EXPECT_NEAR(peaks[2], 0.25, 1 / 60.0);
  EXPECT_THAT(valleys, testing::Contains(testing::DoubleNear(-1 / 24.0, 1 / 60.0)));
  EXPECT_THAT(valleys, testing::Contains(testing::DoubleNear(1 / 24.0, 1 / 60.0)));
  EXPECT_GT(ecg(0.25), ecg(-1 / 6.0));
}

TEST(Ecg, LiesBetweenZeroAndOneAndRepeats) {
  double least = 1, greatest = 0;
  for (int i = 0; i < 5000; ++i) {
    const double phase = i / 5000.0;
    least = std::min(least, ecg(phase));
    greatest = std::max(greatest, ecg(phase));
    EXPECT_NEAR(ecg(phase), ecg(phase - 3), kRounding);
  }
  // The samples miss the extremes by less than 1e-4 of the beat.
  EXPECT_NEAR(least, 0, 1e-4);
  EXPECT_NEAR(greatest, 1, 1e-4);
}

// ---- bad calls -----------------------------------------------------------------------------------------

TEST(BodyClock, RefusesBadCalls) {
  BodyClock clock = clock_of({breath(), heart()});
  const auto message = [](auto&& call) -> std::string {
    try {
      call();
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message([&] { clock.hold("lung"); }),
              HasSubstr("lung: the body has no such mode; choose one of breath, heart"));
  EXPECT_THAT(message([&] { clock.hold("heart", 1.1); }), HasSubstr("`phase` heart=1.1: must be 0 to 1"));
  EXPECT_THAT(message([&] { clock.set_speed("heart", -1); }), HasSubstr("`speed` -1: must be 0 to 100"));
  EXPECT_THAT(message([&] { clock.set_speed(NAN); }), HasSubstr("`speed` nan"));
  EXPECT_THAT(message([&] { (void)clock.next_instant("heart", NAN, 0); }), HasSubstr("`phase` heart=nan"));
}

// ---- the page's clock ----------------------------------------------------------------------------------

BodyClock clock_of(const nlohmann::json& one) {
  std::vector<MotionMode> modes;
  for (const auto& mode : one.at("modes")) {
    MotionMode& made = modes.emplace_back(mode.at("wraps").get<bool>() ? heart() : breath());
    made.name = mode.at("name");
    made.period_s = mode.value("period_s", 0.0);
    if (mode.contains("waveform"))
      for (const auto& sample : mode.at("waveform")) made.waveform.push_back({sample[0], sample[1]});
  }
  return clock_of(std::move(modes), one.at("start_s").get<double>());
}

/// What a step of the file does.
void take(const nlohmann::json& step, BodyClock& clock) {
  const auto mode = [&](const char* does) { return clock.names()[step.at(does).get<std::size_t>()]; };
  if (step.contains("advance")) clock.advance(step.at("advance"));
  if (step.contains("speed")) clock.set_speed(step.at("speed").get<double>());
  if (step.contains("release")) clock.release(mode("release"));
  if (step.contains("hold") && step.contains("phase"))
    clock.hold(mode("hold"), step.at("phase").get<double>());
  else if (step.contains("hold"))
    clock.hold(mode("hold"));
}

void expect_near(const std::vector<double>& found, const nlohmann::json& wanted, const std::string& where) {
  ASSERT_EQ(found.size(), wanted.size()) << where;
  for (std::size_t m = 0; m < found.size(); ++m)
    EXPECT_NEAR(found[m], wanted[m].get<double>(), kRounding) << where;
}

TEST(BodyClock, HasTheValuesThatThePagesClockIsTestedAgainst) {
  std::ifstream file(XRAYCAST_SOURCE_DIR "/tests/systems/body_clock.json");
  const nlohmann::json document = nlohmann::json::parse(file);
  for (const auto& one : document.at("clocks")) {
    BodyClock clock = clock_of(one);
    for (const auto& step : one.at("steps")) {
      take(step, clock);
      const std::string where = step.dump();
      EXPECT_NEAR(clock.time_s(), step.at("time_s").get<double>(), kRounding);
      expect_near(clock.phases(), step.at("phases"), where);
      expect_near(clock.traces_at(clock.time_s()), step.at("traces"), where);
      expect_near(clock.phases_at(clock.time_s() - 0.9), step.at("phases_before"), where);
      for (const auto& next : step.at("next")) {
        const auto found_s = clock.next_instant(clock.names()[next[0].get<std::size_t>()],
                                                next[1].get<double>(), clock.time_s() + 0.1);
        ASSERT_EQ(found_s.has_value(), !next[2].is_null()) << where;
        EXPECT_NEAR(found_s.value_or(0), next[2].is_null() ? 0 : next[2].get<double>(), kRounding) << where;
      }
    }
  }
}

}  // namespace
}  // namespace xraycast::body_clock_test
