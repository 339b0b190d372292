#pragma once

#include "xraycast/window/viewer.hpp"

namespace xraycast {

/// Handles a pressed key of the fluoroscope's console, by GLFW's numbers. Returns false for other keys.
bool handle_console_key(Viewer& viewer, int key);

/// Where the panel begins beside a catheter's, at the lower left of the picture: the viewer's panel ends
/// above.
float exposure_panel_top(const Viewer& viewer);

/// Shows the fluoroscope's settings, technique, dose and subtraction. Call once per frame.
void draw_exposure_panel(Viewer& viewer);

}  // namespace xraycast
