#include "xraycast/acquisition/console.hpp"

#include "xraycast/base/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace xraycast::console_test {
namespace {

constexpr int kSide = 96;

View view_at(double lao_rad) { return {.lao_rad = lao_rad, .width = kSide, .height = kSide, .pixel_mm = 1}; }

FluoroscopyOptions options(const char* stages = "none") {
  return {.c_arm = CArm::named("mobile-flat-panel"), .stages = FluoroscopyStages::from_list(stages)};
}

/// 20 cm of water with a spine, and a vessel of a tau of 0.3 down the middle where it is filled.
std::vector<float> body(bool is_filled) {
  std::vector<float> tau(std::size_t{kSide} * kSide);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const bool is_spine = x > 50 && x < 80, is_vessel = std::abs(x - 48) < 5;
      tau[static_cast<std::size_t>(y * kSide + x)] =
          4.0f + (is_spine ? 1.0f : 0) + (is_vessel && is_filled ? 0.3f : 0);
    }
  return tau;
}

class Console : public testing::Test {
 protected:
  void expose(bool is_filled, int pulses = 1, const View& view = view_at(0)) {
    for (int i = 0; i < pulses; ++i) console_.expose(body(is_filled), view, WaterPath(Opacity::paper()));
  }
  /// Of the middle row.
  int grey(int x) const { return console_.image()[static_cast<std::size_t>(kSide / 2 * kSide + x)]; }
  static constexpr int kVessel = 48, kSoftTissue = 20, kSpine = 70;
  FluoroscopyConsole console_{options()};
};

TEST_F(Console, HoldsTheLastImage) {
  EXPECT_TRUE(console_.image().empty());
  expose(false);
  EXPECT_EQ(console_.image().size(), std::size_t{kSide} * kSide);
  EXPECT_GT(grey(kSoftTissue), grey(kSpine) + 20);
  EXPECT_EQ(console_.dose().pulses, 1) << "settling counts no dose";
}

TEST_F(Console, TakesMasksOfAWholeCycleHoweverFastTheBodyMoves) {
  console_.subtract(true);
  console_.match_masks(MaskMatching{.cycle_s = 0.8});
  for (const auto& [speed, pulses] : {std::pair{1.0, 13}, std::pair{0.5, 25}, std::pair{2.0, 7}}) {
    console_.set_motion_speed(speed);
    console_.take_new_mask();
    int taken = 0;
    for (; console_.is_masking() && taken < 100; ++taken) expose(false);
    EXPECT_EQ(taken, pulses) << "of 15 a second at speed " << speed;
  }
}

TEST_F(Console, PulsesAtItsRateWhileThePedalIsDown) {
  FluoroscopyOptions slow = options();
  slow.pulses_per_s = 7.5;
  console_.set(slow);
  EXPECT_FALSE(console_.is_due(false, 1));
  EXPECT_TRUE(console_.is_due(true, 0)) << "at once";
  int pulses = 0;
  for (int frame = 0; frame < 300; ++frame) pulses += console_.is_due(true, 1.0 / 60);
  // Five seconds; the last one may be just due.
  EXPECT_NEAR(pulses, 37.5, 1);
  EXPECT_FALSE(console_.is_due(false, 10));
}

TEST_F(Console, PutsAPulseOffUntilTheGateOpens) {
  EXPECT_FALSE(console_.is_due(true, 0, false));
  for (int frame = 0; frame < 30; ++frame) EXPECT_FALSE(console_.is_due(true, 1.0 / 60, false));
  EXPECT_TRUE(console_.is_due(true, 1.0 / 60, true));
  EXPECT_FALSE(console_.is_due(true, 0, true)) << "one pulse, however many were put off";
}

TEST_F(Console, SubtractsWhatWasThereBefore) {
  expose(false);
  console_.subtract(true);
  EXPECT_TRUE(console_.is_masking());
  expose(false, 4);
  EXPECT_FALSE(console_.is_masking());
  expose(true, 2);
  const int background = static_cast<int>(std::lround(255 * console_.window.background));
  // Codes of 14 bits are steps of less than a grey; the exposure is locked, so that nothing else changed.
  EXPECT_NEAR(grey(kSoftTissue), background, 2);
  EXPECT_NEAR(grey(kSpine), background, 2);
  // A tau of the map's beam of 0.3 of 0.5, in the fluoroscope's.
  EXPECT_LT(grey(kVessel), background - 60);
}

TEST_F(Console, ShowsMaximumOpacificationAfterTheAgentHasGone) {
  console_.subtract(true);
  expose(false, 4);
  expose(true);
  const int filled = grey(kVessel);
  console_.shows_maximum_opacification = true;
  expose(false, 3);
  EXPECT_NEAR(grey(kVessel), filled, 1);
  console_.shows_maximum_opacification = false;
  expose(false);
  EXPECT_GT(grey(kVessel), filled + 60);
}

TEST_F(Console, BlendsARoadMapOfWhatWasOpacified) {
  EXPECT_FALSE(console_.has_angiogram());
  console_.show_road_map(true);
  EXPECT_FALSE(console_.shows_road_map()) << "there is none";
  console_.subtract(true);
  expose(false, 4);
  expose(true);
  console_.subtract(false);
  expose(false);
  const int vessel = grey(kVessel), tissue = grey(kSoftTissue);
  console_.show_road_map(true);
  expose(false);
  EXPECT_GT(grey(kVessel), vessel + 40) << "bright";
  EXPECT_NEAR(grey(kSoftTissue), tissue, 3);
}

TEST_F(Console, KeepsMaskAndRoadMapBehindOtherBladesAndCompression) {
  console_.subtract(true);
  expose(false, 4);
  expose(true);
  const int filled = grey(kVessel);
  console_.compress(0.8);
  console_.collimate(Collimation{120, 60});  // on the detector: the whole width
  expose(true);
  EXPECT_FALSE(console_.is_masking());
  EXPECT_TRUE(console_.has_angiogram());
  EXPECT_NEAR(grey(kVessel), filled, 3) << "of less scatter";
  console_.collimate({});
  EXPECT_FALSE(console_.is_masking()) << "the mask was taken without blades";
  console_.subtract(false);
  console_.show_road_map(true);
  console_.collimate(Collimation{120, 60});
  console_.compress(0.2);
  expose(false);
  EXPECT_TRUE(console_.shows_road_map());
  console_.subtract(true);
  expose(false, 4);
  console_.collimate(Collimation{100, 50});
  EXPECT_FALSE(console_.is_masking()) << "all of it was open";
  console_.collimate(Collimation{100, 50, 0.5});
  EXPECT_TRUE(console_.is_masking()) << "turned blades open corners of which it has nothing";
  expose(false, 4);
  console_.collimate({});
  EXPECT_TRUE(console_.is_masking()) << "behind blades it has nothing";
  EXPECT_THROW(console_.compress(2), InputError);
  EXPECT_THROW(console_.collimate(Collimation{-1, 5}), InputError);
}

TEST_F(Console, ForgetsMaskAndRoadMapWhenTheCArmMoves) {
  console_.subtract(true);
  expose(false, 4);
  expose(true);
  expose(true, 1, view_at(0.1));
  EXPECT_TRUE(console_.is_masking());
  EXPECT_FALSE(console_.has_angiogram());
  EXPECT_NEAR(grey(kVessel), 255 * console_.window.background, 1) << "subtracted from itself";
}

TEST_F(Console, TakesANewMask) {
  console_.subtract(true);
  expose(false, 4);
  console_.take_new_mask();
  expose(true, 5);
  EXPECT_NEAR(grey(kVessel), 255 * console_.window.background, 2);
}

TEST_F(Console, CountsDoseOverAllSettings) {
  expose(false, 3);
  const DoseRecord before = console_.dose();
  EXPECT_GT(before.air_kerma_mGy, 0);
  FluoroscopyOptions other = options();
  other.c_arm = CArm::named("fixed-single-plane");
  console_.set(other);
  expose(false, 2);
  console_.subtract(true);
  expose(false, 2);
  EXPECT_EQ(console_.dose().pulses, 7);
  EXPECT_GT(console_.dose().air_kerma_mGy, before.air_kerma_mGy);
  EXPECT_NEAR(console_.dose().fluoroscopy_s, 7 / options().pulses_per_s, 1e-9);
}

TEST_F(Console, RaisesTheExposureWithTheDoseLevel) {
  expose(false, 8);
  const double normal = console_.kerma_rate();
  console_.next_dose();
  EXPECT_EQ(console_.options().dose, DoseLevel::cine);
  expose(false, 8);
  EXPECT_GT(console_.kerma_rate(), 2 * normal);
  console_.next_dose();
  expose(false, 8);
  EXPECT_LT(console_.kerma_rate(), normal);
}

TEST_F(Console, TakesANewMaskAtAnotherDose) {
  console_.subtract(true);
  expose(false, 5);
  console_.next_dose();
  EXPECT_TRUE(console_.is_masking());
  expose(false, 4);
  EXPECT_EQ(console_.options().dose, DoseLevel::cine);
  const double cine = console_.kerma_rate();
  EXPECT_NEAR(grey(kSpine), 255 * console_.window.background, 2);
  console_.subtract(false);
  expose(false, 8);
  EXPECT_NEAR(console_.kerma_rate(), cine, 0.1 * cine) << "the exposure control agrees with the lock";
}

TEST_F(Console, NoiseOfEarlierPulsesDoesNotComeAgain) {
  FluoroscopyOptions noisy = options("quanta");
  noisy.kvp = 80;
  noisy.mas = 0.1;
  console_.set(noisy);
  expose(false);
  const std::vector<std::uint8_t> first(console_.image().begin(), console_.image().end());
  noisy.pulses_per_s = 7.5;
  console_.set(noisy);
  expose(false);
  const std::vector<std::uint8_t> second(console_.image().begin(), console_.image().end());
  EXPECT_NE(first, second);
}

TEST_F(Console, ALockedExposureKeepsItsGain) {
  expose(false, 8);
  const int live = grey(kSoftTissue);
  const Technique technique = console_.technique();
  console_.subtract(true);
  expose(false, 6);
  EXPECT_EQ(console_.technique(), technique);
  console_.subtract(false);
  expose(false);
  EXPECT_NEAR(grey(kSoftTissue), live, 1);
}

TEST_F(Console, APauseWithThePedalUpLeavesNothingOfTheLastView) {
  FluoroscopyOptions shown = options("lag,display");
  console_.set(shown);
  EXPECT_TRUE(console_.is_due(true, 0));
  expose(true, 20);
  EXPECT_FALSE(console_.is_due(false, 60));
  EXPECT_TRUE(console_.is_due(true, 0));
  std::vector<float> flat(body(false).size(), 4.0f);
  console_.expose(flat, view_at(0), WaterPath(Opacity::paper()));
  const int tissue = grey(kSoftTissue);
  // Of the spine, 70 greys darker, two fifths of the filter's weight would be left.
  EXPECT_NEAR(grey(kSpine), tissue, 1);
  EXPECT_NEAR(grey(kVessel), tissue, 1);
}

TEST_F(Console, AnotherMapsWaterIsExposedForAtOnce) {
  const WaterPath paper(Opacity::paper()), other(Opacity("strong", {{-1000, 0}, {0, 0.04}}));
  console_.expose(body(false), view_at(0), paper);
  console_.expose(body(false), view_at(0), other);  // half of the water: less exposure follows
  for (int pulse = 0; pulse < 6; ++pulse) console_.expose(body(false), view_at(0), other);
  FluoroscopyConsole fresh(options());
  fresh.expose(body(false), view_at(0), other);
  EXPECT_EQ(console_.technique().kvp, fresh.technique().kvp);
  EXPECT_NEAR(console_.technique().mas / fresh.technique().mas, 1, 0.05);
}

TEST_F(Console, ForgetsMaskAndRoadMapOfAnotherMap) {
  console_.subtract(true);
  expose(false, 5);
  EXPECT_TRUE(console_.has_angiogram());
  console_.expose(body(false), view_at(0), WaterPath(Opacity("strong", {{-1000, 0}, {0, 0.04}})));
  EXPECT_TRUE(console_.is_masking());
  EXPECT_FALSE(console_.has_angiogram());
}

TEST_F(Console, KeepsItsFluoroscopeWhenAViewOrNewSettingsAreRefused) {
  FluoroscopyOptions sharp = options("blur");
  console_.set(sharp);
  View fine = view_at(0);
  fine.pixel_mm = 0.012;
  console_.set(options("none"));
  console_.expose(body(false), fine, WaterPath(Opacity::paper()));
  const DoseRecord before = console_.dose();
  EXPECT_THROW(console_.set({.c_arm = CArm::named("mobile-intensifier")}), InputError) << "pixels too fine";
  EXPECT_EQ(console_.options().c_arm.name, "mobile-flat-panel");
  EXPECT_EQ(console_.dose().air_kerma_mGy, before.air_kerma_mGy);
  console_.expose(body(false), fine, WaterPath(Opacity::paper()));
  EXPECT_EQ(console_.dose().pulses, before.pulses + 1);
}

TEST_F(Console, SubtractionWithLagBeginsAtZero) {
  console_.set(options("lag"));
  expose(false);
  console_.subtract(true);
  expose(false, 6);
  const double background = 255 * console_.window.background;
  // A tau of 0.001 is half a grey; filling traps would leave 0.025.
  EXPECT_NEAR(grey(kSoftTissue), background, 2);
  EXPECT_NEAR(grey(kSpine), background, 2);
}

TEST_F(Console, KeepsItsSettingsWhenNewOnesAreInvalid) {
  FluoroscopyOptions invalid = options();
  invalid.pulses_per_s = 100;
  EXPECT_THROW(console_.set(invalid), InputError);
  EXPECT_EQ(console_.options().pulses_per_s, 15);
}

}  // namespace
}  // namespace xraycast::console_test
