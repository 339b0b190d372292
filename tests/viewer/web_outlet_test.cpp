// What browsers may do to a session, and are told of it.
#include "xraycast/serving/web_outlet.hpp"

#include "support/web_clients.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::web_outlet_test {
namespace {

class WebOutletTest : public testing::Test {
 protected:
  WebOutletTest() {
    intervention_.emplace(
        Intervention::Options{.run = {.tree = std::make_shared<const VesselTree>(
                                          make_phantom("thorax").vessel_branches(), "thorax")}});
  }

  void open(bool moves_hub) {
    outlet_.emplace(WebServer::Options{}, "a page",
                    BodyBounds{.centre_mm = {0, 0, 100}, .half_height_mm = 50}, moves_hub,
                    [](const std::string& line) {
                      if (line.find("was refused") != std::string::npos) throw Error("no log");
                    });
  }

  /// All that is commanded until the pedal is down.
  LiveCommands commanded() {
    LiveCommands all;
    wait_until([&] {
      const LiveCommands now = outlet_->commands();
      all.next_hubs += now.next_hubs;
      all.valve_toggles += now.valve_toggles;
      all.insertion_mm_s = now.insertion_mm_s;
      all.rotation_rad_s = now.rotation_rad_s;
      all.injection_ml_s = now.injection_ml_s;
      return now.pedal;
    });
    return all;
  }

  void publish() {
    intervention_->update(CArmPose{}, 0.01);
    outlet_->publish({.intervention = *intervention_, .c_arm = pose_});
  }

  CArmPose pose_;
  std::optional<Intervention> intervention_;
  std::optional<WebOutlet> outlet_;
};

const std::string kAll = R"({"push":1,"turn":1,"pedal":true,"inject":true,"next_hub":true,"valve":true})";

TEST_F(WebOutletTest, MovesTheHubs) {
  open(true);
  WebTestTab tab(outlet_->server().page_address());
  tab.send(kAll);
  const LiveCommands all = commanded();
  EXPECT_EQ(all.next_hubs, 1);
  EXPECT_EQ(all.valve_toggles, 1);
  EXPECT_GT(all.insertion_mm_s, 0);
  EXPECT_GT(all.rotation_rad_s, 0);
}

TEST_F(WebOutletTest, LeavesHubsAndValveToThoseWhoMoveThem) {
  open(false);
  WebTestTab tab(outlet_->server().page_address());
  tab.send(kAll);
  const LiveCommands all = commanded();
  EXPECT_EQ(all.next_hubs, 0);
  EXPECT_EQ(all.valve_toggles, 0);
  EXPECT_EQ(all.insertion_mm_s, 0);
  EXPECT_EQ(all.rotation_rad_s, 0);
  EXPECT_GT(all.injection_ml_s, 0);
}

TEST_F(WebOutletTest, TellsOfInjectionsByOthers) {
  open(true);
  WebTestTab tab(outlet_->server().page_address());
  tab.receive();  // who steers
  for (const double ml_s : {0.0, 5.0, 0.0}) {
    intervention_->run().inject(ml_s);
    publish();
    EXPECT_EQ((tab.receive().payload.at(1) & 2) != 0, ml_s > 0);
  }
}

TEST_F(WebOutletTest, EndsWithItsServerAlsoWithoutBrowsers) {
  open(true);
  publish();
  WebTestSocket stranger(outlet_->server().port());
  stranger.send("GET / HTTP/1.1\r\nHost: elsewhere\r\n\r\n");  // the log of its refusal fails
  EXPECT_THAT([&] { wait_until([&] { return publish(), false; }); }, testing::ThrowsMessage<Error>("no log"));
}

TEST_F(WebOutletTest, TellsHowFarAnExerciseIs) {
  const auto tree = std::make_shared<const VesselTree>(intervention_->run().tree());
  const Exercise exercise = parse_exercise(R"({"title": "In", "task": "Go in.", "instruments": ["cobra-5f"],
    "entry": [89, -54, -357], "targets": [{"at_mm": [88, -58, -325]}]})",
                                           "e.json", *tree);
  intervention_.emplace(Intervention::Options{
      .run = {.tree = tree, .instruments = instruments_named(exercise.instruments), .entry = exercise.entry},
      .exercise = exercise});
  open(true);
  WebTestTab tab(outlet_->server().page_address());
  intervention_->manual()->set_rates(100, 0);
  std::string told;
  wait_until([&] {
    publish();
    for (std::string text = tab.receive().payload; text.starts_with('{'); text = tab.receive().payload)
      told = text;
    return told.find(R"("is_complete":true)") != std::string::npos;
  });
  EXPECT_THAT(told, testing::HasSubstr(R"("exercise":{"title":"In")"));
  EXPECT_THAT(told, testing::HasSubstr(R"("task":"Go in.")"));
  EXPECT_THAT(told, testing::HasSubstr(R"("is_complete":true)"));
}

}  // namespace
}  // namespace xraycast::web_outlet_test
