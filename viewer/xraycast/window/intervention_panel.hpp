#pragma once

#include "xraycast/window/viewer.hpp"

struct GLFWwindow;

namespace xraycast {

/// Help on the keys of an intervention, one line each.
extern const char* const kInterventionHelp;

/// Applies the held keys, mouse or gamepad to pedal, hub and injector. Call once per frame.
void handle_held_input(Viewer& viewer, GLFWwindow* window);

/// Shows the loads at the hub, the tip's location, fluoroscopy time and contrast agent used. Call once per
/// frame.
void draw_intervention_panel(Viewer& viewer);

}  // namespace xraycast
