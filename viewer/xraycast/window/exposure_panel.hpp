#pragma once

#include "xraycast/window/viewer.hpp"

namespace xraycast {

/// Help on the fluoroscope's keys but for pedal and road map, one line each.
extern const char* const kFluoroscopeHelp;

/// Handles a pressed key of the fluoroscope's console, by GLFW's numbers. Returns false for other keys.
bool handle_console_key(Viewer& viewer, int key);

/// Where the panel begins beside a catheter's, at the lower left of a window of that height: the viewer's
/// panel ends above.
float exposure_panel_top(float height);

/// Shows the fluoroscope's settings, technique, dose and subtraction. Call once per frame.
void draw_exposure_panel(Viewer& viewer);

}  // namespace xraycast
