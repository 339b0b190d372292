#pragma once

#include "xraycast/window/viewer.hpp"

struct GLFWwindow;

namespace xraycast {

/// What keys, mouse and gamepad do at the table, as lines of help.
extern const char* const kInterventionHelp;

/// Moves the hub by what keys, mouse or gamepad hold down, steps on the pedal and injects. Once a frame.
void handle_intervention(Viewer& viewer, GLFWwindow* window);

/// The loads at the hub, where the tip is, and what has been used of X-rays and contrast agent. Once a frame.
void draw_intervention_panel(Viewer& viewer);

}  // namespace xraycast
