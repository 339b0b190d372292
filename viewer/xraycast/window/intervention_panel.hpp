#pragma once

#include "xraycast/window/viewer.hpp"

#include <string>

struct GLFWwindow;

namespace xraycast {

/// Help on the keys of an intervention but for pedal and road map, one line each.
std::string help_on_steering(const Intervention& intervention);

/// Applies the held keys, mouse or gamepad to pedal, hub and injector. Call once per frame.
void handle_held_input(Viewer& viewer, GLFWwindow* window);

/// Shows the loads at the hub, the tip's location, fluoroscopy time and contrast agent used, and exchanges
/// the instrument in the hand. Call once per frame.
void draw_intervention_panel(Viewer& viewer);

}  // namespace xraycast
