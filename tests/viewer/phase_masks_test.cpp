#include "xraycast/acquisition/phase_masks.hpp"

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/acquisition/mask_phase.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace xraycast::phase_masks_test {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

std::shared_ptr<const Displacement> shift(double z_mm) {
  return affine_displacement(glm::dmat3(1), {0, 0, z_mm});
}

Motion breath_and_heart() {
  MotionMode breath{"breath", 4, {}, {{0, nullptr}, {1, shift(12)}}};
  MotionMode heart{"heart", 0, {{0, 0}, {0.8, 1}, {1.8, 2}}, {{0, nullptr}, {0.4, shift(3)}}};
  return Motion({breath, heart}, "motion.json");
}

TEST(MaskPhase, IsMatchedOrOfAMode) {
  EXPECT_FALSE(parse_mask_phase("matched").fixed);
  EXPECT_EQ(parse_mask_phase("heart=0.75").fixed, (PhaseGate{"heart", 0.75}));
  for (const char* text : {"", "heart", "heart=", "=1", "heart=x"})
    EXPECT_THROW(parse_mask_phase(text), InputError) << text;
}

TEST(MaskPhase, IsMatchedByTheHeart) {
  const MaskMatching matched = matching_of({}, breath_and_heart());
  EXPECT_EQ(matched.mode, 1);
  EXPECT_TRUE(matched.wraps);
  EXPECT_FALSE(matched.phase);
  EXPECT_NEAR(matched.cycle_s, 0.9, 1e-12) << "the mean of two beats";
  const MaskMatching breath = matching_of(parse_mask_phase("breath=1"), breath_and_heart());
  EXPECT_EQ(breath.mode, 0);
  EXPECT_FALSE(breath.wraps);
  EXPECT_EQ(breath.phase, 1);
  EXPECT_EQ(breath.cycle_s, 4);
  EXPECT_THROW(matching_of(parse_mask_phase("cough=1"), breath_and_heart()), InputError);
  EXPECT_THROW(matching_of(parse_mask_phase("heart=2"), breath_and_heart()), InputError);
}

TEST(PhaseMasks, GiveTheNearestAroundTheCycle) {
  PhaseMasks masks;
  for (const float phase : {0.1f, 0.5f, 0.9f}) masks.add(phase, std::vector{phase});
  EXPECT_THAT(masks.nearest(0.02, true), ElementsAre(0.1f));
  EXPECT_THAT(masks.nearest(0.98, true), ElementsAre(0.9f));
  EXPECT_THAT(masks.nearest(0.0, false), ElementsAre(0.1f));
  EXPECT_THAT(masks.nearest(0.65, true), ElementsAre(0.5f));
}

TEST(PhaseMasks, AreNoMoreForALongWaveform) {
  PhaseMasks masks;
  for (int i = 0; i < 1000; ++i) {
    const double phase = 0.001 * i;
    masks.add(phase, std::vector{static_cast<float>(phase)});
  }
  EXPECT_EQ(masks.count(), 1000);
  EXPECT_EQ(masks.kept(), PhaseMasks::kMost);
  // Half a share of the phases from the middle of one, and a step of theirs.
  for (const double phase : {0.0, 0.31, 0.77, 0.999})
    EXPECT_NEAR(masks.nearest(phase, true)[0], phase, 0.5 / PhaseMasks::kMost + 0.001) << phase;
  masks.clear();
  EXPECT_EQ(masks.count(), 0);
}

/// A picture that is the same at the same phase.
std::vector<float> body_at(double phase) { return std::vector<float>(12, static_cast<float>(1 + phase)); }

View small_view() { return {.width = 4, .height = 3, .pixel_mm = 1}; }

TEST(Acquisition, SubtractsTheMaskOfItsPhaseWhereMasksAreMatched) {
  AcquisitionOptions options{.subtracts = true};
  for (const bool is_matched : {true, false}) {
    if (is_matched)
      options.mask_matching = MaskMatching{};
    else
      options.mask_matching.reset();
    Acquisition acquisition(options, small_view(), {});
    acquisition.begin_mask();
    for (int i = 0; i < 10; ++i) {
      const std::vector<double> phases{0.1 * i};
      const std::vector<float> picture = body_at(phases[0]);
      acquisition.set_phases(phases);
      acquisition.expose(picture, small_view(), Acquisition::Use::mask);
    }
    EXPECT_EQ(acquisition.mask_frames(), 10);
    const std::vector<double> phases{0.72};
    std::vector<float> picture = body_at(0.7);
    picture[5] += 0.5f;  // contrast agent
    acquisition.set_phases(phases);
    const auto difference = acquisition.expose(picture, small_view()).difference;
    EXPECT_NEAR(difference[5] - difference[0], 0.5, 1e-6);
    // The mean of all phases is that of 0.45.
    EXPECT_NEAR(difference[0], is_matched ? 0 : 0.25, 1e-5);
  }
}

TEST(Acquisition, SubtractsTheMaskOfOnePhaseWhereThatIsAskedFor) {
  Acquisition acquisition({.subtracts = true, .mask_matching = MaskMatching{.phase = 0.2}}, small_view(), {});
  acquisition.begin_mask();
  for (int i = 0; i < 10; ++i) {
    const std::vector<double> phases{0.1 * i};
    const std::vector<float> picture = body_at(phases[0]);
    acquisition.set_phases(phases);
    acquisition.expose(picture, small_view(), Acquisition::Use::mask);
  }
  const std::vector<double> phases{0.6};
  const std::vector<float> picture = body_at(0.6);
  acquisition.set_phases(phases);
  const auto difference = acquisition.expose(picture, small_view()).difference;
  EXPECT_THAT(std::vector<float>(difference.begin(), difference.end()),
              Each(testing::FloatNear(0.4f, 1e-5f)));
}

}  // namespace
}  // namespace xraycast::phase_masks_test
