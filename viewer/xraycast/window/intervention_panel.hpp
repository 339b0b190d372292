#pragma once

#include "xraycast/window/viewer.hpp"

struct GLFWwindow;

namespace xraycast {

/// Applies the held keys, mouse or gamepad to pedal, hub and injector. Call once per frame.
void handle_held_input(Viewer& viewer, GLFWwindow* window);

/// Plots a hub's force and torque.
void show_loads(const SimulatedRun& run, std::size_t hub);

/// Shows the loads at the hub, the tip's location, fluoroscopy time and contrast agent used, and exchanges
/// the instrument in the hand. Call once per frame.
void draw_intervention_panel(Viewer& viewer);

}  // namespace xraycast
