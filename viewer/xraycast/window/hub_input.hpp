#pragma once

#include <functional>
#include <optional>

struct GLFWgamepadstate;

namespace xraycast {

/// The operator's input: the hub's velocity, the fluoroscopy pedal, the injector.
struct HubInput {
  double insertion_mm_s = 0, rotation_rad_s = 0;  ///< velocity of the hub
  bool pedal = false, injects = false;
};

/// By keys of GLFW: arrows move the hub (with Shift slowly), X is the pedal, I injects.
HubInput held_keys(const std::function<bool(int key)>& is_down);

/// Whether a key is one of these, or changes what others do: it is held rather than pressed.
bool is_held_down(int key);

/// By a gamepad: the left stick sets the hub's velocity, with a dead zone of a seventh; A is the pedal, B
/// injects.
HubInput held_pad(const GLFWgamepadstate& pad);

/// The first gamepad that is connected.
std::optional<GLFWgamepadstate> connected_pad();

}  // namespace xraycast
