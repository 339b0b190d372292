#include "xraycast/window/hub_input.hpp"

#define GLFW_INCLUDE_NONE
#include <gtest/gtest.h>

#include <GLFW/glfw3.h>
#include <numbers>
#include <set>

namespace xraycast::hub_input_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

HubInput with_keys(const std::set<int>& held) {
  return held_keys([&](int key) { return held.contains(key); });
}

/// The left stick, to the right and down.
GLFWgamepadstate pad_with(float right, float down) {
  GLFWgamepadstate pad{};
  pad.axes[GLFW_GAMEPAD_AXIS_LEFT_X] = right;
  pad.axes[GLFW_GAMEPAD_AXIS_LEFT_Y] = down;
  return pad;
}

TEST(HubInput, ArrowsPushAndTurn) {
  EXPECT_EQ(with_keys({}).insertion_mm_s, 0);
  EXPECT_EQ(with_keys({GLFW_KEY_UP}).insertion_mm_s, 40);
  EXPECT_EQ(with_keys({GLFW_KEY_DOWN}).insertion_mm_s, -40);
  EXPECT_EQ(with_keys({GLFW_KEY_UP, GLFW_KEY_DOWN}).insertion_mm_s, 0);
  EXPECT_DOUBLE_EQ(with_keys({GLFW_KEY_LEFT}).rotation_rad_s, -120 * kRadians);
  const HubInput slowly = with_keys({GLFW_KEY_UP, GLFW_KEY_RIGHT, GLFW_KEY_RIGHT_SHIFT});
  EXPECT_DOUBLE_EQ(slowly.insertion_mm_s, 8);
  EXPECT_DOUBLE_EQ(slowly.rotation_rad_s, 24 * kRadians);
}

TEST(HubInput, KnowsTheKeysThatAreHeldDown) {
  for (const int key : {GLFW_KEY_UP, GLFW_KEY_RIGHT, GLFW_KEY_X, GLFW_KEY_I, GLFW_KEY_LEFT_SHIFT})
    EXPECT_TRUE(is_held_down(key)) << key;
  for (const int key : {GLFW_KEY_G, GLFW_KEY_ENTER, GLFW_KEY_1}) EXPECT_FALSE(is_held_down(key)) << key;
}

TEST(HubInput, KeysAreThePedalAndTheSyringe) {
  EXPECT_FALSE(with_keys({GLFW_KEY_UP}).pedal);
  EXPECT_TRUE(with_keys({GLFW_KEY_X}).pedal);
  EXPECT_FALSE(with_keys({GLFW_KEY_X}).injects);
  EXPECT_TRUE(with_keys({GLFW_KEY_I}).injects);
}

TEST(HubInput, AStickPushesForwardsAndTurnsToTheRight) {
  EXPECT_DOUBLE_EQ(held_pad(pad_with(0, -1)).insertion_mm_s, 40);
  EXPECT_DOUBLE_EQ(held_pad(pad_with(0, 1)).insertion_mm_s, -40);
  EXPECT_DOUBLE_EQ(held_pad(pad_with(1, 0)).rotation_rad_s, 120 * kRadians);
  EXPECT_DOUBLE_EQ(held_pad(pad_with(-1, 0)).rotation_rad_s, -120 * kRadians);
}

TEST(HubInput, AStickThatIsLetGoDoesNotCreep) {
  const HubInput let_go = held_pad(pad_with(0.14f, -0.14f));
  EXPECT_EQ(let_go.insertion_mm_s, 0);
  EXPECT_EQ(let_go.rotation_rad_s, 0);
  // From there on speed grows from nothing.
  EXPECT_LT(held_pad(pad_with(0, -0.16f)).insertion_mm_s, 1);
  EXPECT_GT(held_pad(pad_with(0, -0.16f)).insertion_mm_s, 0);
}

TEST(HubInput, ButtonsAreThePedalAndTheSyringe) {
  GLFWgamepadstate pad = pad_with(0, 0);
  pad.buttons[GLFW_GAMEPAD_BUTTON_A] = GLFW_PRESS;
  EXPECT_TRUE(held_pad(pad).pedal);
  EXPECT_FALSE(held_pad(pad).injects);
  pad.buttons[GLFW_GAMEPAD_BUTTON_B] = GLFW_PRESS;
  EXPECT_TRUE(held_pad(pad).injects);
}

}  // namespace
}  // namespace xraycast::hub_input_test
