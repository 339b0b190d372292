#pragma once

#include "xraycast/window/viewer.hpp"

struct GLFWwindow;

namespace xraycast {

/// Help on the keys of an intervention, a line each.
extern const char* const kInterventionHelp;

/// Applies the held keys, mouse or gamepad to hub, pedal and injector. Once a frame.
void handle_intervention(Viewer& viewer, GLFWwindow* window);

/// Shows the loads at the hub, the tip's location, fluoroscopy time and contrast agent used. Once a frame.
void draw_intervention_panel(Viewer& viewer);

}  // namespace xraycast
