#include "xraycast/acquisition/map_acquisition.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace xraycast::acquisition_test {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

constexpr int kSide = 64;
const View kView{.cone = Cone{785, 1200}, .width = kSide, .height = kSide, .pixel_mm = 2};

std::vector<float> slab(double tau) {
  return std::vector<float>(std::size_t{kSide} * kSide, static_cast<float>(tau));
}

/// Water, with contrast agent in the picture's left half.
class Half {
 public:
  RayDepths rays(bool has_contrast) {
    tau_ = slab(4);
    for (std::size_t i = 0; has_contrast && i < tau_.size(); ++i)
      if (i % kSide < kSide / 2) tau_[i] += 0.5f;
    return tau_;
  }

 private:
  std::vector<float> tau_;
};

FluoroscopyOptions quiet() { return options_of({.c_arm = "fixed-single-plane", .stages = "none"}); }

WaterPath paper() { return WaterPath(Opacity::paper()); }

TEST(Acquisition, WithoutAFluoroscopeFramesAreOpticalDepths) {
  Half scene;
  Acquisition acquisition({}, kView, paper());
  const AcquiredFrame& frame = acquisition.expose(scene.rays(true), kView);
  EXPECT_EQ(frame.tau.front(), 4.5f);
  EXPECT_EQ(frame.pulse, nullptr);
  EXPECT_TRUE(frame.difference.empty());
  EXPECT_FALSE(acquisition.record());
}

TEST(Acquisition, SettlesBeforeTheFirstFrame) {
  const FluoroscopyOptions options = options_of({.c_arm = "fixed-single-plane", .dose = "low", .seed = 7});
  Fluoroscope fluoroscope(options, kView, paper());
  fluoroscope.settle(slab(6));
  Acquisition acquisition({.fluoroscope = options}, kView, paper());
  for (int pulse = 0; pulse < 3; ++pulse)
    EXPECT_EQ(acquisition.expose(slab(6), kView).pulse->codes, fluoroscope.expose(slab(6)).codes);
  EXPECT_EQ(acquisition.record()->dose.pulses, 3) << "settling counts no dose";
  EXPECT_TRUE(acquisition.record()->has_dose);
}

TEST(Acquisition, SubtractsFromAMaskOfTheSameExposure) {
  Half scene;
  Acquisition acquisition({.fluoroscope = quiet(), .subtracts = true}, kView, paper());
  for (const double lao_rad : {0.0, 0.5}) {
    View view = kView;
    view.lao_rad = lao_rad;
    acquisition.begin_mask();
    acquisition.expose(scene.rays(false), view, Acquisition::Use::mask);
    const AcquiredFrame& frame = acquisition.expose(scene.rays(true), view);
    EXPECT_GT(frame.difference.front(), 0.2f);
    EXPECT_EQ(frame.difference.back(), 0) << "exposed as the mask";
    EXPECT_EQ(acquisition.mask_frames(), 1);
  }
}

TEST(Acquisition, DifferencesBehindTheBladesAreZero) {
  FluoroscopyOptions options = options_of({.collimate = {60, 60}, .seed = 3});
  Acquisition acquisition({.fluoroscope = options, .subtracts = true}, kView, paper());
  acquisition.expose(slab(4), kView, Acquisition::Use::mask);
  const AcquiredFrame& frame = acquisition.expose(slab(4), kView);
  EXPECT_THAT(frame.difference.first(kSide), Each(0.0f));
  const auto middle = frame.difference.subspan(std::size_t{kSide} * kSide / 2 + kSide / 2 - 4, 8);
  EXPECT_THAT(middle, ::testing::Not(Each(0.0f))) << "noise";
}

TEST(Acquisition, MaximumOpacificationKeepsWhatHasGone) {
  Half scene;
  Acquisition acquisition({.subtracts = true, .shows_maximum_opacification = true}, kView, paper());
  acquisition.expose(slab(4), kView, Acquisition::Use::mask);
  acquisition.expose(scene.rays(true), kView);
  const AcquiredFrame& frame = acquisition.expose(scene.rays(false), kView);
  EXPECT_EQ(frame.difference.front(), 0.5f);
  EXPECT_EQ(frame.difference.back(), 0);
}

std::string message_of(const std::function<void()>& work) {
  try {
    work();
    return "accepted";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(Acquisition, SaysWhatIsWrongWithAFluoroscopeThatIsAskedFor) {
  const auto message = [](const FluoroscopeRequest& request) {
    return message_of([&] { options_of(request); });
  };
  EXPECT_EQ(message({}), "accepted");
  EXPECT_THAT(message({.field_mm = 100}), HasSubstr("`field_mm` 100: is a field of a C-arm; add `c_arm`"));
  EXPECT_THAT(message({.c_arm = "mobile-flat-panel", .field_mm = 1}), HasSubstr("choose one of them"));
  EXPECT_THAT(message({.collimate = {1}}), HasSubstr("`collimate` 1: must be WIDTH,HEIGHT"));
  EXPECT_THAT(message({.dose = "high"}), HasSubstr("`dose` high: must be low, normal or cine"));
  EXPECT_THAT(message({.stages = "x"}), HasSubstr("unknown stage"));
}

TEST(Acquisition, SaysWhatIsWrongWithAPicture) {
  const auto message = [](const char* look, const auto& change, bool has_vessels = false) {
    return message_of([&] {
      PictureOptions options;
      choose_look(look, options);
      change(options);
      check(options, has_vessels, false);
    });
  };
  const auto nothing = [](PictureOptions&) {};
  const auto exposed = [](PictureOptions& options) { options.acquisition.fluoroscope = quiet(); };
  EXPECT_EQ(message("fluoro", nothing), "accepted");
  EXPECT_THAT(message("x", nothing), HasSubstr("`look` x: must be fluoro, surface or dsa"));
  EXPECT_THAT(message("surface", nothing), HasSubstr("`look` surface: there is nothing to shade"));
  EXPECT_THAT(message("dsa", nothing), HasSubstr("`look` dsa: there are no vessels"));
  EXPECT_THAT(message("surface", exposed, true), HasSubstr("cannot show shaded surfaces"));
  const auto whole = [](PictureOptions& options) { options.style.full_contrast = true; };
  EXPECT_THAT(message("dsa", whole, true), HasSubstr("`full_contrast` does not apply to `look` dsa"));
  const auto walled = [](PictureOptions& options) { options.style.sampling.wall_radius_mm = 100; };
  EXPECT_THAT(message("fluoro", walled),
              HasSubstr("`wall_radius_mm` 100: applies only to `compositing` wall"));
}

}  // namespace
}  // namespace xraycast::acquisition_test
