#pragma once

#include "xraycast/window/operator_keys.hpp"
#include "xraycast/window/viewer.hpp"

#include <vector>

namespace xraycast {

/// Whether the mouse moves while a button is held. The frame in which the button went down does not count:
/// during a slow frame the mouse may have moved far.
bool is_dragged(int button);

/// Handles the mouse where no panel captures it: left drag rotates (with Shift, and for spheres, it also
/// tilts), left click picks a vessel, middle drag moves the table, right drag changes window and level, the
/// wheel magnifies. Call within a frame of Dear ImGui.
void handle_mouse(Viewer& viewer);

/// Handles a pressed key, by GLFW's numbers. Returns true for Ctrl+O, which asks for the panel's file
/// dialogue.
bool handle_key(Viewer& viewer, int key, int mods);

/// The mouse and the keys beside an operator's (see usable_keys).
std::vector<KeyHint> general_keys(const Viewer& viewer);

}  // namespace xraycast
