#pragma once

#include "xraycast/viewer/viewer.hpp"

namespace xraycast {

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
