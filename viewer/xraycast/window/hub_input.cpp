#include "xraycast/window/hub_input.hpp"

#include "xraycast/haptics/hand_rates.hpp"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

/// A stick's axis, -1 to 1, without its dead zone: released sticks do not return to the very centre.
double beyond_dead_zone(double axis) {
  constexpr double kDead = 0.15;
  return std::copysign(std::max(0.0, std::abs(axis) - kDead) / (1 - kDead), axis);
}

}  // namespace

HubInput held_keys(const std::function<bool(int key)>& is_down) {
  const auto way = [&](int forwards, int back) {
    return (is_down(forwards) ? 1.0 : 0.0) - (is_down(back) ? 1.0 : 0.0);
  };
  const double speed = is_down(GLFW_KEY_LEFT_SHIFT) || is_down(GLFW_KEY_RIGHT_SHIFT) ? kSlowly : 1;
  return {speed * kPush_mm_s * way(GLFW_KEY_UP, GLFW_KEY_DOWN),
          speed * kRotate_rad_s * way(GLFW_KEY_RIGHT, GLFW_KEY_LEFT), is_down(GLFW_KEY_X),
          is_down(GLFW_KEY_I)};
}

bool is_held_down(int key) {
  constexpr std::array kKeys{GLFW_KEY_UP,    GLFW_KEY_DOWN, GLFW_KEY_LEFT,
                             GLFW_KEY_RIGHT, GLFW_KEY_X,    GLFW_KEY_I};
  return std::ranges::find(kKeys, key) != kKeys.end() ||
         (key >= GLFW_KEY_LEFT_SHIFT && key <= GLFW_KEY_RIGHT_SUPER);
}

HubInput held_pad(const GLFWgamepadstate& pad) {
  return {-kPush_mm_s * beyond_dead_zone(pad.axes[GLFW_GAMEPAD_AXIS_LEFT_Y]),  // which grows downwards
          kRotate_rad_s * beyond_dead_zone(pad.axes[GLFW_GAMEPAD_AXIS_LEFT_X]),
          pad.buttons[GLFW_GAMEPAD_BUTTON_A] == GLFW_PRESS, pad.buttons[GLFW_GAMEPAD_BUTTON_B] == GLFW_PRESS};
}

std::optional<GLFWgamepadstate> connected_pad() {
  GLFWgamepadstate pad;
  for (int joystick = GLFW_JOYSTICK_1; joystick <= GLFW_JOYSTICK_LAST; ++joystick)
    if (glfwGetGamepadState(joystick, &pad) == GLFW_TRUE) return pad;
  return std::nullopt;
}

}  // namespace xraycast
