#pragma once

#include "xraycast/window/viewer.hpp"

namespace xraycast {

/// Whether the mouse moves while a button is held. A frame in which the button went down does not count: in a
/// slow one the mouse may have come from far away before.
bool is_dragged(int button);

/// What the mouse has done since the last frame, where no panel takes it: left drag rotates (with Shift, and
/// for spheres, it also tilts), left click names a vessel's branch, middle drag moves the table, right drag
/// changes window and level, the wheel magnifies. Within a frame of Dear ImGui.
void handle_mouse(Viewer& viewer);

/// A key of GLFW that was pressed, and its modifiers. Returns true for Ctrl+O, which is the panel's to
/// answer.
bool handle_key(Viewer& viewer, int key, int mods);

/// What the two above do, in words, a line each.
extern const char* const kHelp;

}  // namespace xraycast
