#pragma once

#include "xraycast/window/operator_keys.hpp"
#include "xraycast/window/viewer.hpp"

namespace xraycast {

OperatorState operator_state(const Viewer& viewer);

/// In the picture whether it is live or held, and advice; while a catheter is steered also a monitor beside
/// it (dose, time, contrast agent, loads at the hub), unless the panels take its place, and the usable keys
/// below it. Reserves the room of both for the next frame. Call once per frame.
void draw_operator_screen(Viewer& viewer);

/// The width of the column beside the picture, which the panel of the catheter may take.
float monitor_width();

/// One line for each key. Call within a window of Dear ImGui.
void list_keys(const std::vector<KeyHint>& keys);

}  // namespace xraycast
