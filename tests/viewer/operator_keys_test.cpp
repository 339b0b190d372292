#include "xraycast/window/operator_keys.hpp"

#include "xraycast/simulation/exercise.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace xraycast::operator_keys_test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

std::vector<std::string> keys_in(const OperatorState& state) {
  std::vector<std::string> keys;
  for (const KeyHint& hint : usable_keys(state)) keys.push_back(hint.keys);
  return keys;
}

std::string what_does(const std::string& key, const OperatorState& state) {
  for (const KeyHint& hint : usable_keys(state))
    if (hint.keys == key) return hint.does;
  return {};
}

/// A catheter at the keyboard, under a fluoroscope.
OperatorState at_the_table() {
  return {.steers = true, .is_steered_by_keys = true, .has_agent_outlet = true, .exposes = true};
}

TEST(OperatorKeys, AreThoseThatDoSomethingNow) {
  EXPECT_THAT(keys_in({}), ElementsAre("P", "E", "A", "H")) << "a map alone";
  EXPECT_THAT(keys_in(at_the_table()), ElementsAre("X", "↑ ↓", "← →", "Shift", "I", "D", "G", "T", "Enter",
                                                   "Backspace", "P", "E", "A", "H"));

  OperatorState state = at_the_table();
  state.is_steered_by_keys = state.has_agent_outlet = false;
  EXPECT_THAT(keys_in(state), Not(Contains("↑ ↓"))) << "a haptic device";
  EXPECT_THAT(keys_in(state), Not(Contains("I"))) << "wires alone";
  state.is_steered_by_mouse = true;
  EXPECT_THAT(keys_in(state), Contains("Ctrl drag"));
  state.has_valve = true;
  EXPECT_THAT(keys_in(state), testing::IsSupersetOf({"Tab", "V"}));
}

TEST(OperatorKeys, SaveTheReportOfAnExercise) {
  OperatorState state = at_the_table();
  state.has_exercise = true;
  EXPECT_EQ(what_does("Ctrl+R", state), "save report");
}

TEST(OperatorKeys, HaveWordsForAllLimits) {
  for (const ExerciseLimit& limit : kExerciseLimits)
    EXPECT_NE(words_of_limit(limit.name), limit.name) << limit.name;
}

TEST(OperatorKeys, HoldABodyInMotion) {
  OperatorState state = at_the_table();
  EXPECT_THAT(keys_in(state), Not(Contains("B")));
  state.has_breath = true;
  EXPECT_THAT(keys_in(state), testing::IsSupersetOf({"B", "W", ", ."}));
  EXPECT_THAT(keys_in(state), Not(Contains("K"))) << "no heart";
  EXPECT_EQ(what_does("B", state), "hold breath");
  state.holds_breath = true;
  EXPECT_EQ(what_does("B", state), "breathe on");
  state.has_heart = state.holds_heart = true;
  EXPECT_EQ(what_does("K", state), "heart beats on");
  state.gate = "heart at 75 %";
  EXPECT_EQ(what_does("W", state), "gate: on");
  state.opens_gate = false;
  EXPECT_THAT(advice_on(state), IsEmpty()) << "nobody exposes";
  state.is_live = true;
  EXPECT_THAT(advice_on(state), ElementsAre(HasSubstr("never opens (heart at 75 %)")));
}

TEST(OperatorKeys, ComeAndGoWithSubtractionAndRecordings) {
  OperatorState state = at_the_table();
  state.subtracts = state.is_masking = true;
  EXPECT_THAT(keys_in(state), Not(Contains("N"))) << "it is taking the mask";
  state.is_masking = false;
  EXPECT_THAT(keys_in(state), Contains("N"));
  EXPECT_THAT(keys_in(state), Not(Contains("M"))) << "nothing was opacified";
  state.has_angiogram = true;
  EXPECT_THAT(keys_in(state), Contains("M"));
  state.exposes = false;
  EXPECT_THAT(keys_in(state), Contains("M")) << "the vessels' outline";
  EXPECT_THAT(keys_in(state), Not(Contains("G")));

  EXPECT_THAT(keys_in(state), Not(Contains("L")));
  state.has_recording = true;
  EXPECT_THAT(keys_in(state), Contains("L"));
  state.is_recording = true;
  EXPECT_THAT(keys_in(state), Not(Contains("L")));
  EXPECT_EQ(what_does("Enter", state), "stop recording");
}

TEST(OperatorKeys, SayWhatIsSet) {
  OperatorState state = at_the_table();
  EXPECT_EQ(what_does("D", state), "dose: normal");
  state.dose = DoseLevel::cine;
  EXPECT_EQ(what_does("D", state), "dose: cine");
  EXPECT_EQ(what_does("T", state), "table follows: off");
  state.follows = true;
  EXPECT_EQ(what_does("T", state), "table follows: on");
  state.has_angiogram = true;
  EXPECT_EQ(what_does("M", state), "road map");
  state.shows_road_map = true;
  EXPECT_EQ(what_does("M", state), "road map: on");
}

TEST(Advice, SuggestsCineForSubtractionAtALowerDose) {
  OperatorState state = at_the_table();
  state.dose = DoseLevel::low;
  EXPECT_THAT(advice_on(state), IsEmpty()) << "no subtraction";
  state.subtracts = true;
  EXPECT_THAT(advice_on(state), ElementsAre("Subtraction is noisy at low dose: press D twice for cine"));
  state.dose = DoseLevel::normal;
  EXPECT_THAT(advice_on(state), ElementsAre("Subtraction is noisy at normal dose: press D for cine"));
  state.is_automatic = false;
  EXPECT_THAT(advice_on(state), IsEmpty()) << "the level sets no exposure";
  state.is_automatic = true;
  state.dose = DoseLevel::cine;
  EXPECT_THAT(advice_on(state), IsEmpty());
}

TEST(Advice, TellsWhyNothingIsInjected) {
  OperatorState state = at_the_table();
  state.injects = true;
  state.has_agent_outlet = false;
  EXPECT_THAT(advice_on(state), ElementsAre(HasSubstr("draw the wire back")));
  state.has_agent_outlet = true;
  EXPECT_THAT(advice_on(state), IsEmpty());
}

TEST(Advice, LeadsThroughTheMask) {
  OperatorState state = at_the_table();
  state.dose = DoseLevel::cine;
  state.subtracts = state.is_masking = true;
  EXPECT_THAT(advice_on(state), ElementsAre(HasSubstr("hold X for the mask")));
  state.is_live = true;
  EXPECT_THAT(advice_on(state), ElementsAre(HasSubstr("keep still")));
  state.exposes = false;
  EXPECT_THAT(advice_on(state), IsEmpty());
}

}  // namespace
}  // namespace xraycast::operator_keys_test
