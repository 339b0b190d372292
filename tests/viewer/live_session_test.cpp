#include "xraycast/serving/live_session.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <thread>
#include <utility>

namespace xraycast::live_session_test {
namespace {

/// What a client commands, and what it was shown.
class Outlet final : public LiveOutlet {
 public:
  LiveCommands commands() override {
    LiveCommands now = commanded;
    commanded.c_arm.reset();
    commanded.next_hubs = commanded.valve_toggles = 0;
    return now;
  }
  bool wants_pictures() const override { return wants; }
  void publish(const LiveFrame& frame) override {
    ++frames;
    pictures += frame.picture != nullptr;
    is_outdated = frame.is_outdated;
    c_arm = frame.c_arm;
  }

  LiveCommands commanded;
  bool wants = false, is_outdated = false;
  int frames = 0, pictures = 0;
  CArmPose c_arm;
};

/// Counts what it is asked for.
class Painter final : public LivePainter {
 public:
  bool is_due(bool is_live, bool is_gate_open, double passed_s) override {
    live_frames += is_live;
    passed_s_ += passed_s;
    return is_live && is_gate_open && pulse_is_due;
  }
  const LivePicture& draw(const Intervention& intervention) override {
    const CArmPose& pose = intervention.pose();
    if (std::abs(pose.cranial_rad) > steepest_rad) throw InputError("too steep");
    ++paintings;
    from = pose;
    return picture_;
  }

  bool pulse_is_due = true;
  double steepest_rad = 1;
  int live_frames = 0, paintings = 0;
  double passed_s() const { return passed_s_; }
  CArmPose from;

 private:
  double passed_s_ = 0;
  LivePicture picture_;
};

class Live : public testing::Test {
 protected:
  static constexpr double kFrame_s = 0.1;

  Live() { begin({"cobra-5f"}); }

  void begin(const std::vector<std::string>& models, const BodyRequest& body = {}) {
    session_.reset();
    intervention_.emplace(
        Intervention::Options{.run = {.tree = std::make_shared<const VesselTree>(
                                          make_phantom("thorax").vessel_branches(), "thorax"),
                                      .instruments = instruments_named(models),
                                      .body = body}});
    session_.emplace(*intervention_, BodyBounds{.centre_mm = {0, 0, 100}, .half_height_mm = 50}, pose_,
                     painter_, [this](const std::string& line) { log_ += line + "\n"; });
    session_->add(outlet_);
    session_->add(other_);
  }

  /// A breath of 4 s, and a beat of half a second.
  static BodyRequest breath_and_heart() {
    const auto shift = [](double z_mm) { return affine_displacement(glm::dmat3(1), {0, 0, z_mm}); };
    return {.motion = std::make_shared<const Motion>(
                std::vector<MotionMode>{{"breath", 4, {}, {{0, nullptr}, {1, shift(4)}}},
                                        {"heart", 0.5, {}, {{0, nullptr}, {0.4, shift(1)}}}},
                "motion.json")};
  }

  void frames(int count) {
    for (int i = 0; i < count; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      session_->step(kFrame_s);
    }
  }

  CArmPose pose_;
  Painter painter_;
  std::string log_;
  Outlet outlet_, other_;
  std::optional<Intervention> intervention_;
  std::optional<LiveSession> session_;
};

TEST_F(Live, DrawsOnlyWhereSomebodyWatchesAndSomethingIsNew) {
  outlet_.commanded.pedal = true;
  frames(5);
  EXPECT_EQ(painter_.paintings, 1) << "the first, and nobody watches";
  EXPECT_TRUE(outlet_.is_outdated);
  EXPECT_EQ(outlet_.frames, 5);
  other_.wants = true;
  frames(5);
  EXPECT_EQ(painter_.paintings, 6);
  EXPECT_EQ(outlet_.pictures, 6) << "whoever asked";
  EXPECT_FALSE(outlet_.is_outdated);
  outlet_.commanded.pedal = false;
  frames(5);
  EXPECT_EQ(painter_.paintings, 6) << "the last image is held";
  EXPECT_EQ(session_->counts().frames, 15);
  EXPECT_EQ(session_->counts().pictures, 6);
}

TEST_F(Live, ShowsTheLastExposureToWhomComesLater) {
  outlet_.commanded.pedal = true;
  frames(2);
  outlet_.commanded.pedal = false;
  frames(2);
  EXPECT_EQ(outlet_.pictures, 1);
  EXPECT_TRUE(outlet_.is_outdated);
  outlet_.wants = true;
  frames(2);
  EXPECT_EQ(outlet_.pictures, 2);
}

TEST_F(Live, WaitsForAFluoroscopesPulse) {
  outlet_.wants = true;
  frames(1);
  outlet_.commanded.pedal = true;
  painter_.pulse_is_due = false;
  frames(3);
  EXPECT_EQ(outlet_.pictures, 1) << "the first";
  painter_.pulse_is_due = true;
  frames(1);
  EXPECT_EQ(outlet_.pictures, 2);
  EXPECT_FALSE(outlet_.is_outdated);
  // Frames between pulses are none that a picture is missing of, also when the pedal goes up after one.
  painter_.pulse_is_due = false;
  frames(2);
  outlet_.commanded.pedal = false;
  frames(3);
  EXPECT_EQ(outlet_.pictures, 2);
  EXPECT_FALSE(outlet_.is_outdated);
}

TEST_F(Live, ThePulsesClockRunsWhoeverWatches) {
  outlet_.commanded.pedal = true;
  frames(4);
  EXPECT_EQ(painter_.live_frames, 4);
  outlet_.commanded.pedal = false;
  frames(3);
  EXPECT_EQ(painter_.live_frames, 4) << "and learns of the pedal's release";
  EXPECT_NEAR(painter_.passed_s(), 7 * kFrame_s, 1e-9);
}

// ---- what cannot be drawn

TEST_F(Live, ThrowsWhereTheFirstPictureCannotBeDrawn) {
  painter_.steepest_rad = -1;
  EXPECT_THROW(session_->step(0), InputError);
}

TEST_F(Live, StaysWhereItCanBeDrawnAndSaysSoOnce) {
  painter_.steepest_rad = 0.5;
  outlet_.wants = true;
  outlet_.commanded.pedal = true;
  outlet_.commanded.c_arm = CArmRequest{.lao_rad = 1, .cranial_rad = 0.4};
  frames(1);
  EXPECT_EQ(painter_.from.cranial_rad, 0.4);
  for (int i = 0; i < 3; ++i) {
    outlet_.commanded.c_arm = CArmRequest{.lao_rad = 2, .cranial_rad = 0.6};
    frames(1);
    EXPECT_EQ(outlet_.pictures, i + 2) << "the exposure, from before";
    EXPECT_EQ(painter_.from.cranial_rad, 0.4);
    EXPECT_EQ(intervention_->pose().lao_rad, 1);
  }
  frames(1);
  EXPECT_EQ(outlet_.c_arm.cranial_rad, 0.4);
  EXPECT_EQ(log_, "the C-arm stays where it was: too steep\n");
  outlet_.commanded.c_arm = CArmRequest{.lao_rad = 2, .cranial_rad = -0.3};
  frames(1);
  EXPECT_EQ(painter_.from.cranial_rad, -0.3);
  outlet_.commanded.c_arm = CArmRequest{.cranial_rad = -0.7};
  frames(1);
  EXPECT_EQ(painter_.from.cranial_rad, -0.3);
  EXPECT_EQ(std::ranges::count(log_, '\n'), 2);
}

TEST_F(Live, AnExposureThatNobodySawIsShownFromWhereItCanBeDrawn) {
  painter_.steepest_rad = 0.5;
  frames(1);
  outlet_.commanded.pedal = true;
  outlet_.commanded.c_arm = CArmRequest{.cranial_rad = 0.6};
  frames(2);
  outlet_.commanded.pedal = false;
  frames(1);
  outlet_.wants = true;
  frames(2);
  EXPECT_EQ(outlet_.pictures, 2);
  EXPECT_EQ(painter_.from.cranial_rad, 0);
  EXPECT_EQ(intervention_->pose().cranial_rad, 0);
}

// ---- what is commanded

TEST_F(Live, ThePedalIsDownWhileItIsInAnyOutlet) {
  outlet_.commanded.pedal = other_.commanded.pedal = true;
  frames(1);
  EXPECT_TRUE(intervention_->is_live());
  outlet_.commanded.pedal = false;
  frames(1);
  EXPECT_TRUE(intervention_->is_live());
  other_.commanded.pedal = false;
  frames(1);
  EXPECT_FALSE(intervention_->is_live());
}

TEST_F(Live, MovesTheHubAndInjects) {
  outlet_.commanded.insertion_mm_s = 100;
  outlet_.commanded.injection_ml_s = 2;
  other_.commanded.injection_ml_s = 4;
  while (intervention_->run().now().time_s < 0.5) frames(1);
  EXPECT_GT(intervention_->run().now().pose.insertion_mm, 10);
  // Of half a second, but for the first frames.
  EXPECT_NEAR(intervention_->run().injected_ml(), 4 * intervention_->run().now().time_s, 0.4);
}

TEST_F(Live, EmbolisesByParticlesInTheAgent) {
  outlet_.commanded.injection_ml_s = 4;
  while (intervention_->run().injected_ml() < 0.5) frames(1);
  EXPECT_TRUE(intervention_->run().embolised().empty());
  other_.commanded.particles = Particles{0.3};
  frames(1);
  other_.commanded.particles.reset();
  while (intervention_->run().injected_ml() < 6) frames(1);  // more than a heartbeat
  ASSERT_FALSE(intervention_->run().embolised().empty());
  EXPECT_LT(intervention_->run().embolised().front().open_share, 1);
  frames(2);
  EXPECT_THAT(intervention_->run().monitor().json(false), testing::HasSubstr("periphery_percent"));
}

TEST_F(Live, FillsBalloonsAndDrawsSheaths) {
  begin({"balloon-6x20"});
  outlet_.commanded.insertion_mm_s = 300;
  while (intervention_->run().now().pose.insertion_mm < 100) frames(1);
  outlet_.commanded.insertion_mm_s = 0;
  other_.commanded.balloons_bar[0] = 5;
  frames(1);
  other_.commanded.balloons_bar[0].reset();
  while (intervention_->run().now().balloon_bar < 4.9) frames(1);
  EXPECT_EQ(intervention_->run().inflation_bar(0), 5);
  outlet_.commanded.balloons_bar[0] = 0;
  outlet_.commanded.sheaths_mm[0] = 10;  // of an instrument without one
  while (intervention_->run().now().balloon_bar > 0) frames(1);
  EXPECT_EQ(intervention_->run().now().pose.release_mm, 0);
}

TEST_F(Live, TheCArmGoesWhereItIsSentWithinItsLimits) {
  outlet_.commanded.c_arm = CArmRequest{.lao_rad = 1, .cranial_rad = 0.3};
  frames(1);
  EXPECT_NEAR(outlet_.c_arm.lao_rad, 1, 1e-12);
  EXPECT_NEAR(outlet_.c_arm.cranial_rad, 0.3, 1e-12);
  EXPECT_EQ(outlet_.c_arm.table_mm, 0);
  EXPECT_EQ(outlet_.c_arm.zoom, 1);
  outlet_.commanded.c_arm = CArmRequest{.lao_rad = 7, .cranial_rad = -2, .centre_z_mm = 130, .zoom = 1000};
  frames(1);
  EXPECT_NEAR(outlet_.c_arm.lao_rad, 7 - 2 * std::numbers::pi, 1e-12);
  EXPECT_EQ(outlet_.c_arm.cranial_rad, -CArmPose::kMaxTilt_rad);
  EXPECT_NEAR(outlet_.c_arm.table_mm, 30, 1e-12);
  EXPECT_EQ(outlet_.c_arm.zoom, CArmPose::kMaxZoom);
  outlet_.commanded.c_arm = CArmRequest{.centre_z_mm = 1000};
  frames(1);
  EXPECT_EQ(outlet_.c_arm.table_mm, 50) << "the end of the body";
}

TEST_F(Live, HubsAreTakenAndTheValveIsLocked) {
  begin({"cobra-5f", "guidewire-035-angled"});
  outlet_.commanded.next_hubs = 1;
  outlet_.commanded.valve_toggles = 1;
  frames(3);
  EXPECT_EQ(intervention_->held_hub(), 1u);
  EXPECT_TRUE(intervention_->run().is_valve_locked());
}

TEST_F(Live, ExposesABodyAtItsOwnTime) {
  begin({"cobra-5f"}, breath_and_heart());
  outlet_.commanded.pedal = outlet_.wants = true;
  std::vector<double> hearts;
  for (int i = 0; i < 10; ++i) {
    frames(4);
    hearts.push_back(intervention_->phases().at(1));
    EXPECT_EQ(intervention_->phases(), intervention_->run().now().phases);
  }
  EXPECT_GT(std::ranges::max(hearts) - std::ranges::min(hearts), 0.1);
  outlet_.commanded.pedal = false;
  frames(1);
  const std::vector<double> held = intervention_->phases();
  frames(10);
  EXPECT_EQ(intervention_->phases(), held) << "the last image is held, and the body goes on";
  EXPECT_NE(intervention_->run().now().phases, held);
}

TEST_F(Live, ExposesWhenAGateOpens) {
  begin({"cobra-5f"}, breath_and_heart());
  outlet_.commanded.pedal = outlet_.wants = true;
  outlet_.commanded.body = parse_body_changes("gate heart 0.5");
  frames(1);
  outlet_.commanded.body = {};
  long exposures = intervention_->exposures();
  const double begin_s = intervention_->body()->time_s();
  int gated = 0;
  while (intervention_->body()->time_s() < begin_s + 2) {
    frames(1);
    if (std::exchange(exposures, intervention_->exposures()) == intervention_->exposures()) continue;
    ++gated;
    // A step or two late; a loaded machine wakes up later: 0.1 is 50 ms.
    EXPECT_NEAR(intervention_->phases().at(1), 0.5, 0.1);
  }
  EXPECT_NEAR(gated, 4, 1);
  EXPECT_NEAR(static_cast<double>(intervention_->body()->traces().exposures_s.size()), gated, 2);
}

TEST_F(Live, HoldsWhatClientsAskForAndSaysOnceWhatCannotBe) {
  begin({"cobra-5f"}, breath_and_heart());
  outlet_.commanded.body_texts = {"hold breath", "hold heart 0.25", "speed 2"};
  frames(1);
  outlet_.commanded.body_texts = {"hold cough"};
  frames(3);
  const LiveBody& body = *intervention_->body();
  EXPECT_TRUE(body.modes()[0].is_held);
  EXPECT_NEAR(body.modes()[1].phase, 0.25, 1e-9);
  EXPECT_EQ(body.speed(), 2);
  EXPECT_EQ(log_,
            "the body goes on as it did: cough: the body has no such mode; choose one of breath, heart\n");
}

TEST_F(Live, HasNoBodyToHoldWhereItIsStill) {
  outlet_.commanded.body_texts = {"hold breath"};
  frames(2);
  EXPECT_EQ(intervention_->body(), nullptr);
  EXPECT_TRUE(intervention_->phases().empty());
  EXPECT_EQ(log_, "the body goes on as it did: the body is still, or its motion is not known\n");
}

}  // namespace
}  // namespace xraycast::live_session_test
