#pragma once

#include "xraycast/window/viewer.hpp"

namespace xraycast {

/// Help on the keys of the fluoroscope, one line each.
extern const char* const kFluoroscopeHelp;

/// Handles a pressed key of the fluoroscope's console, by GLFW's numbers. Returns false for other keys.
bool handle_console_key(Viewer& viewer, int key);

/// Shows the fluoroscope's settings, technique, dose and subtraction. Call once per frame.
void draw_exposure_panel(Viewer& viewer);

}  // namespace xraycast
