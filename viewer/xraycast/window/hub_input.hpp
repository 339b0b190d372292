#pragma once

#include <functional>
#include <optional>

struct GLFWgamepadstate;

namespace xraycast {

/// What hands and feet hold down at the table.
struct HubInput {
  double insertion_mm_s = 0, rotation_rad_s = 0;  ///< how fast the hub is moved
  bool pedal = false, injects = false;
};

/// By keys of GLFW: arrows move the hub (with Shift slowly), X is the pedal, I injects.
HubInput held_keys(const std::function<bool(int key)>& is_down);

/// By a gamepad: the left stick moves the hub, the faster the farther it is held, and not at all within a
/// seventh of its way; A is the pedal, B injects.
HubInput held_pad(const GLFWgamepadstate& pad);

/// The first gamepad that is connected.
std::optional<GLFWgamepadstate> connected_pad();

}  // namespace xraycast
