// What browsers say to a live session, and what they are told of it.
#include "xraycast/serving/browser_hand.hpp"

#include "xraycast/haptics/hand_rates.hpp"
#include "xraycast/trainer/browser_message.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <cstring>
#include <iostream>
#include <numbers>

namespace xraycast::browser_hand_test {
namespace {

using Clock = BrowserHand::Clock;
using std::chrono::milliseconds;

const Clock::time_point kStart = Clock::now();

TEST(BrowserHand, MovesTheHubAsKeysDo) {
  BrowserHand hand(0);
  ASSERT_TRUE(hand.receive(R"({"push": 1, "turn": -0.5, "pedal": true, "inject": true})", kStart));
  const LiveCommands quick = hand.commands(kStart);
  EXPECT_EQ(quick.insertion_mm_s, kPush_mm_s);
  EXPECT_EQ(quick.rotation_rad_s, -0.5 * kRotate_rad_s);
  EXPECT_TRUE(quick.pedal);
  EXPECT_EQ(quick.injection_ml_s, kInjection_ml_s);
  ASSERT_TRUE(hand.receive(R"({"push": -1, "slow": true, "something new": [1]})", kStart));
  const LiveCommands slow = hand.commands(kStart);
  EXPECT_EQ(slow.insertion_mm_s, -kSlowly * kPush_mm_s);
  EXPECT_EQ(slow.rotation_rad_s, 0);
  EXPECT_FALSE(slow.pedal);
  EXPECT_EQ(slow.injection_ml_s, 0);
}

TEST(BrowserHand, DoesDeedsOnce) {
  BrowserHand hand(0);
  hand.receive(R"({"next_hub": true})", kStart);
  hand.receive(R"({"next_hub": true, "valve": true})", kStart);
  hand.receive(R"({"push": 1})", kStart);
  LiveCommands commands = hand.commands(kStart);
  EXPECT_EQ(commands.next_hubs, 2);
  EXPECT_EQ(commands.valve_toggles, 1);
  commands = hand.commands(kStart);
  EXPECT_EQ(commands.next_hubs, 0);
  EXPECT_EQ(commands.valve_toggles, 0);
  EXPECT_EQ(commands.insertion_mm_s, kPush_mm_s);  // held all the while
  for (int i = 0; i < 1000; ++i) hand.receive(R"({"next_hub": true})", kStart);
  EXPECT_EQ(hand.commands(kStart).next_hubs, 100);
}

TEST(BrowserHand, PosesTheCArm) {
  BrowserHand hand(250);
  hand.receive(R"({"c_arm": {"lao_deg": 30, "cranial_deg": -10, "zoom": 2, "table_mm": 20}})", kStart);
  hand.receive("{}", kStart);
  const auto pose = hand.commands(kStart).c_arm;
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->lao_rad, std::numbers::pi / 6, 1e-12);
  EXPECT_NEAR(pose->cranial_rad, -std::numbers::pi / 18, 1e-12);
  EXPECT_EQ(pose->zoom, 2);
  EXPECT_EQ(pose->centre_z_mm, 270);
  EXPECT_FALSE(hand.commands(kStart).c_arm);
}

TEST(BrowserHand, HoldsNothingOnceItIsSilentOrHasLeft) {
  BrowserHand hand(0);
  const std::string held = R"({"push": 1, "turn": 1, "pedal": true, "inject": true})";
  hand.receive(held, kStart);
  EXPECT_TRUE(hand.commands(kStart + BrowserHand::kSilence).pedal);
  const LiveCommands silent = hand.commands(kStart + BrowserHand::kSilence + milliseconds(1));
  EXPECT_EQ(silent.insertion_mm_s, 0);
  EXPECT_EQ(silent.rotation_rad_s, 0);
  EXPECT_EQ(silent.injection_ml_s, 0);
  EXPECT_FALSE(silent.pedal);
  hand.receive(held, kStart);
  hand.let_go();
  EXPECT_FALSE(hand.commands(kStart).pedal);
}

TEST(BrowserHand, PassesOverWhatIsMalformed) {
  BrowserHand hand(0);
  hand.receive(R"({"push": 1})", kStart);
  for (const char* text : {"",
                           "push",
                           "[]",
                           "1",
                           "null",
                           "{\"push\": 1",
                           R"({"push": 2})",
                           R"({"push": -1.01})",
                           R"({"push": 1e999})",
                           R"({"push": "1"})",
                           R"({"push": null})",
                           R"({"turn": true})",
                           R"({"pedal": 1})",
                           R"({"next_hub": "yes"})",
                           R"({"c_arm": 1})",
                           R"({"c_arm": {"lao_deg": 1e9}})",
                           R"({"body": 1})",
                           R"({"body": {"hold": true}})",
                           R"({"body": {"hold": {"breath": "now"}}})",
                           R"({"body": {"hold": {"breath": 2}}})",
                           R"({"body": {"speed": -1}})",
                           R"({"body": {"speed": "fast"}})",
                           R"({"body": {"gate": "heart"}})",
                           R"({"body": {"gate": {"mode": 1}}})",
                           R"({"body": {"gate": {"mode": "heart", "phase": 2}}})",
                           R"({"c_arm": {"zoom": 0}})",
                           R"({"c_arm": {"table_mm": "high"}})",
                           "{\"push\": \xff}"})
    EXPECT_FALSE(hand.receive(text, kStart)) << text;
  EXPECT_FALSE(hand.receive(std::string(512, '['), kStart));
  EXPECT_EQ(hand.commands(kStart).insertion_mm_s, kPush_mm_s);
}

template <typename Value>
Value value_at(const std::string& bytes, std::size_t at) {
  Value value;
  std::memcpy(&value, bytes.substr(at, sizeof value).data(), sizeof value);
  return value;
}

TEST(BrowserMessage, HasItsFieldsInOrder) {
  BrowserMessage message{.time_s = 1.5,
                         .fluoroscopy_s = 2.5,
                         .injected_ml = 3.5,
                         .aortic_mmHg = 110,
                         .packing = 0.25,
                         .exposes = true,
                         .is_valve_locked = true,
                         .held_hub = 1,
                         .exposures = 7,
                         .devices = {{.matter = DeviceMatter::nitinol,
                                      .points = {{{1, 2, 3}, 0.5}, {{4, 5, 6}, 0.25}},
                                      .inner_radius_mm = 0.125}},
                         .drums_mg_ml = {0, 350, 0, 12.5f},
                         .drums_mm = {{1, 1}, {2, 2.5}, {1, 1}, {3, 3.5}}};
  const PushedCoil coil{.model = {.loop_mm = 10, .length_mm = 300}, .laid_mm = 300, .is_in_sac = true};
  message.instruments.push_back({.pose = {100, std::numbers::pi, 8, 20, 2},
                                 .load = {0.5, 2e-3},
                                 .tip_branch = 21,
                                 .tip_along_mm = 12.5,
                                 .balloon_mm = 6,
                                 .free_rings = 3,
                                 .coil = coil,
                                 .pressure = {100, 120, 80, 93},
                                 .parts_mm = {{{1, 2, 3}, {4, 5, 6}}}});
  message.instruments.push_back({.pose = {}, .load = {}, .parts_mm = {{}, {{7, 8, 9}}}});
  const std::string bytes = packed(message);
  EXPECT_EQ(bytes.substr(0, 4), std::string("\5\15\1\2", 4));
  EXPECT_EQ(value_at<std::uint32_t>(bytes, 4), 7u);
  std::vector<float> rest;
  for (std::size_t at = 8; at < bytes.size(); at += 4) rest.push_back(value_at<float>(bytes, at));
  const auto whole = [](std::uint32_t number) {
    float as_real = 0;
    std::memcpy(&as_real, &number, sizeof number);
    return as_real;
  };
  const std::vector<float> wanted{
      1.5f,     2.5f,     3.5f,     110,      0.25f,    100,      180,   0.5f, 2,        whole(21), 12.5f,
      8,        6,        20,       whole(3), whole(2), whole(1), 10,    300,  300,      100,       120,
      80,       93,       whole(1), whole(2), 1,        2,        3,     4,    5,        6,  //
      0,        0,        0,        0,        whole(0), 0,        0,     0,    0,        whole(0),  whole(0),
      whole(0), 0,        0,        0,        0,        0,        0,     0,    whole(2), whole(0),  whole(1),
      7,        8,        9,  //
      whole(1), whole(2), 0.125f,   whole(2), 1,        2,        3,     0.5f, 4,        5,         6,
      0.25f,  //
      whole(2), whole(1), 350,      2,        2.5f,     whole(3), 12.5f, 3,    3.5f,     whole(0)};
  EXPECT_EQ(rest, wanted);

  message.instruments.clear();
  message.devices.clear();
  message.body_time_s = 20;
  message.body_speed = 2;
  message.modes = {{.is_held = true, .phase = 0.25, .trace = {0.5f, 0.75f}},
                   {.is_gate = true, .phase = 0.5, .gate = 0.75, .trace = {0.125f, 1}}};
  message.exposures_s = {19.5};
  message.drums_moved_mm = {{0, 0, 0}, {1, 2, 3}, {0, 0, 0}, {4, 5, 6}};
  const std::string moving = packed(message);
  std::vector<float> body;
  for (std::size_t at = 28 + 4 * 10; at < moving.size(); at += 4) body.push_back(value_at<float>(moving, at));
  const std::vector<float> told{whole(2), 20,       2,    whole(1), 0.25f,    0,      whole(2), 0.5f,
                                0.75f,    whole(2), 0.5f, 0.75f,    whole(2), 0.125f, 1,        whole(1),
                                19.5f,    1,        2,    3,        4,        5,      6};
  EXPECT_EQ(body, told);
}

TEST(BrowserHand, FillsBalloonsAndDrawsSheathsOnce) {
  BrowserHand hand(0);
  ASSERT_TRUE(hand.receive(R"({"balloon": {"instrument": 1, "bar": 8}})", kStart));
  ASSERT_TRUE(hand.receive(R"({"sheath": {"instrument": 0, "mm": 20}})", kStart));
  ASSERT_TRUE(hand.receive(R"({"detach": {"instrument": 2}})", kStart));
  ASSERT_TRUE(hand.receive(R"({"particles": {"mm": 0.5}})", kStart));
  ASSERT_TRUE(hand.receive(R"({})", kStart));
  ASSERT_TRUE(hand.receive(R"({"push": 1})", kStart));
  const LiveCommands told = hand.commands(kStart), again = hand.commands(kStart);
  EXPECT_FALSE(told.balloons_bar[0]);
  EXPECT_EQ(told.balloons_bar[1], 8);
  EXPECT_EQ(told.sheaths_mm[0], 20);
  ASSERT_TRUE(told.particles);
  EXPECT_EQ(told.particles->diameter_mm, 0.5);
  EXPECT_FALSE(again.particles);
  EXPECT_TRUE(told.detaches[2]);
  EXPECT_FALSE(told.detaches[0] || again.detaches[2]);
  EXPECT_FALSE(again.balloons_bar[1] || again.sheaths_mm[0]);
  for (const char* text :
       {R"({"balloon": 8})", R"({"balloon": {}})", R"({"balloon": {"instrument": 1}})",
        R"({"balloon": {"bar": 1}})", R"({"balloon": {"instrument": 3, "bar": 8}})",
        R"({"balloon": {"instrument": 0.5, "bar": 8}})", R"({"balloon": {"instrument": 0, "bar": -1}})",
        R"({"balloon": {"instrument": 0, "bar": "8"}})", R"({"sheath": {"instrument": 0, "mm": 1e9}})",
        R"({"particles": {"mm": 0.05}})", R"({"particles": {"mm": 2}})", R"({"particles": 0.5})",
        R"({"particles": {}})", R"({"detach": true})", R"({"detach": {}})",
        R"({"detach": {"instrument": 3}})"})
    EXPECT_FALSE(hand.receive(text, kStart)) << text;
}

TEST(BrowserHand, ChangesTheBodyOnce) {
  BrowserHand hand(0);
  ASSERT_TRUE(hand.receive(
      R"({"body": {"hold": {"breath": true, "heart": 0.5}, "speed": 2, "gate": {"mode": "heart", "phase": 0.75}}})",
      kStart));
  ASSERT_TRUE(hand.receive(R"({"body": {"hold": {"breath": false}}})", kStart));
  ASSERT_TRUE(hand.receive(R"({"push": 1})", kStart));
  const BodyChanges body = hand.commands(kStart).body;
  EXPECT_FALSE(body.holds.at("breath").is_held);
  EXPECT_TRUE(body.holds.at("heart").is_held);
  EXPECT_EQ(body.holds.at("heart").phase, 0.5);
  EXPECT_EQ(body.speed, 2);
  EXPECT_EQ(body.gate.value(), (PhaseGate{"heart", 0.75}));
  EXPECT_TRUE(hand.commands(kStart).body.is_empty());
  ASSERT_TRUE(hand.receive(R"({"body": {"gate": null}})", kStart));
  const auto gate = hand.commands(kStart).body.gate;
  ASSERT_TRUE(gate.has_value());
  EXPECT_FALSE(gate->has_value());
}

// Two instruments of 200 points and 500 drums with contrast agent, as late in an angiogram; the JSON in
// hundredths.
TEST(BrowserMessage, IsSmallerThanItsJson) {
  const auto rounded = [](double x) { return std::round(100 * x) / 100; };
  BrowserMessage message{.drums_mg_ml = std::vector<float>(500)};
  nlohmann::json json;
  for (std::size_t d = 0; d < 2; ++d) {
    BrowserMessage::Instrument& instrument = message.instruments.emplace_back();
    instrument.parts_mm.resize(1);
    for (int i = 0; i < 200; ++i) {
      const glm::dvec3& point = instrument.parts_mm[0].emplace_back(12.345 + i, 1.7 * i - 100, 4.21 * i);
      json["instruments"][d].push_back({rounded(point.x), rounded(point.y), rounded(point.z)});
    }
  }
  for (std::size_t drum = 0; drum < 500; ++drum) {
    message.drums_mg_ml[drum] = 100.25f + 0.5f * static_cast<float>(drum);
    message.drums_mm.emplace_back(2.25f, 2.5f);
    json["drums"].push_back({drum, message.drums_mg_ml[drum], 2.25, 2.5});
  }
  const std::size_t binary_B = packed(message).size(), json_B = json.dump().size();
  std::cout << binary_B << " bytes, as JSON " << json_B << '\n';
  EXPECT_LT(binary_B, json_B);
}

}  // namespace
}  // namespace xraycast::browser_hand_test
