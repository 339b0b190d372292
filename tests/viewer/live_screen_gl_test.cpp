// What a session's clients see, under whatever OpenGL there is without a display.
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/serving/live_screen.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace xraycast::live_screen_gl_test {
namespace {

constexpr int kWidth = 64, kHeight = 48;

/// A cylinder in two layers, and a catheter in it.
class Screen : public testing::Test {
 protected:
  Screen() {
    auto map = std::make_shared<BodyMap>();
    map->geometry.width = 16;
    map->geometry.height = 40;
    map->geometry.radii_mm = shell_radii_mm(RadiiRule::equal_area, 2, 60);
    map->geometry.centre_mm = {{0, 0}};
    map->geometry.top_mm = 100;
    map->geometry.row_spacing_mm = 5;
    map->geometry.step_mm = 1;
    map->tau.assign(2 * map->layer_size(), 0.5f);
    map_ = map;
    bounds_ = bounds_of(map->geometry);
    VesselBranch branch;
    branch.points = {{{0, 0, -90}, 3}, {{0, 0, 90}, 3}};
    intervention_.emplace(Intervention::Options{
        .run = {.tree = std::make_shared<const VesselTree>(std::vector{std::move(branch)}, "tube"),
                .instruments = instruments_named({"microcatheter-27f"})}});
    intervention_->update({}, 0.1);
  }

  LiveScreen::Options options() const {
    return {.view = fitted({.centre_mm = bounds_.centre_mm, .width = kWidth, .height = kHeight}, bounds_)};
  }

  std::shared_ptr<const BodyMap> map_;
  BodyBounds bounds_;
  std::optional<Intervention> intervention_;
};

TEST_F(Screen, DrawsTheCameraOfTheLastExposure) {
  CArmPose pose{.lao_rad = 0.5, .cranial_rad = 0.1, .table_mm = 10, .zoom = 2};
  intervention_->press_pedal(true);
  intervention_->update(pose, 0.1);
  LiveScreen screen(map_, options());
  const LivePicture* picture = &screen.draw(*intervention_);
  EXPECT_EQ(picture->view.lao_rad, 0.5);
  EXPECT_EQ(picture->view.cranial_rad, 0.1);
  EXPECT_EQ(picture->view.centre_mm.z, bounds_.centre_mm.z + 10);
  EXPECT_EQ(picture->view.pixel_mm, options().view.pixel_mm / 2);
  EXPECT_EQ(picture->greys.size(), std::size_t{kWidth * kHeight});
  EXPECT_TRUE(picture->codes.empty());
  const auto [darkest, lightest] = std::ranges::minmax(picture->greys);
  EXPECT_LT(darkest + 20, lightest);
}

TEST_F(Screen, SixteenBitsShowWhatEightDo) {
  for (const bool is_full : {false, true}) {
    LiveScreen::Options coarse = options();
    coarse.style.full_contrast = is_full;
    coarse.style.window.gamma = 1.5;
    LiveScreen::Options fine = coarse;
    fine.is_fine = true;
    std::vector<std::uint8_t> greys;
    {
      LiveScreen screen(map_, coarse);  // one OpenGL context at a time
      greys = screen.draw(*intervention_).greys;
    }
    LiveScreen screen(map_, fine);
    const LivePicture* picture = &screen.draw(*intervention_);
    ASSERT_TRUE(picture->greys.empty() && picture->codes.size() == greys.size());
    for (std::size_t i = 0; i < greys.size(); ++i)
      // A grey of eight bits is 257 of sixteen; the driver rounds in 8 bits, and gamma in 32-bit floats.
      EXPECT_NEAR(picture->codes[i] / 257.0, greys[i], 1) << i;
  }
}

/// A client that keeps its foot on the pedal, or not.
class Outlet final : public LiveOutlet {
 public:
  LiveCommands commands() override { return {.pedal = pedal, .c_arm = std::exchange(c_arm, std::nullopt)}; }
  bool wants_pictures() const override { return wants; }
  void publish(const LiveFrame& frame) override {
    if (!frame.picture) return;
    ++pictures;
    last = *frame.picture;
  }

  bool pedal = false, wants = true;
  std::optional<CArmRequest> c_arm;
  int pictures = 0;
  LivePicture last;
};

TEST_F(Screen, AFluoroscopeTakesItsPulses) {
  LiveScreen::Options with = options();
  with.fluoroscopy = FluoroscopyOptions{.c_arm = CArm::named("mobile-flat-panel"), .pulses_per_s = 10};
  with.view.cone = with.fluoroscopy->c_arm.distances;
  with.view.pixel_mm = 4;
  with.is_fine = true;
  LiveScreen screen(map_, with);
  Outlet outlet;
  LiveSession live(*intervention_, bounds_, {}, screen, [](const std::string&) {});
  live.add(outlet);
  const auto pulses_after = [&](double passed_s) {
    live.step(passed_s);
    EXPECT_EQ(screen.console()->dose().pulses, outlet.pictures);
    return outlet.pictures;
  };
  EXPECT_EQ(pulses_after(0.1), 1) << "the first picture needs no pedal";
  ASSERT_EQ(outlet.last.codes.size(), std::size_t{kWidth * kHeight});
  EXPECT_GT(std::ranges::max(outlet.last.codes), 255);
  outlet.pedal = true;
  EXPECT_EQ(pulses_after(0.03), 2) << "at once when the pedal goes down";
  EXPECT_EQ(pulses_after(0.03), 2);
  EXPECT_EQ(pulses_after(0.03), 2);
  EXPECT_EQ(pulses_after(0.05), 3) << "0.11 s after the last pulse";
  EXPECT_EQ(pulses_after(0.03), 3);
  outlet.pedal = false;
  EXPECT_EQ(pulses_after(0.03), 3) << "no X-rays without the pedal";
  EXPECT_EQ(pulses_after(20), 3);
  outlet.pedal = true;
  EXPECT_EQ(pulses_after(0.01), 4) << "a new run begins with a pulse";
}

TEST_F(Screen, AWideConeIsTiltedAsFarAsItCanBeDrawn) {
  LiveScreen::Options wide = options();
  wide.view.cone = Cone{780, 1200};
  wide.view.pixel_mm = 20;  // half the diagonal is 34 deg from the axis
  LiveScreen screen(map_, wide);
  Outlet outlet{};
  std::string log;
  LiveSession live(*intervention_, bounds_, {}, screen, [&](const std::string& line) { log += line; });
  live.add(outlet);
  outlet.pedal = true;
  live.step(0.1);
  outlet.c_arm = CArmRequest{.cranial_rad = CArmPose::kMaxTilt_rad};
  live.step(0.1);
  EXPECT_EQ(outlet.last.view.cranial_rad, 0);
  EXPECT_NE(log.find("a tilt of 50 deg looks along the map's axis"), std::string::npos) << log;
  outlet.c_arm = CArmRequest{.cranial_rad = 0.5};
  live.step(0.1);
  EXPECT_EQ(outlet.last.view.cranial_rad, 0.5);
  EXPECT_EQ(outlet.pictures, 3);
}

}  // namespace
}  // namespace xraycast::live_screen_gl_test
