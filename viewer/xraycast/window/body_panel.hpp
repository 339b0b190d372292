#pragma once

#include "xraycast/window/viewer.hpp"

namespace xraycast {

/// Handles a pressed key that holds the breath, arrests the heart, or changes speed or gate, by GLFW's
/// numbers. Returns false for other keys, and where the body is still.
bool handle_body_key(Viewer& viewer, int key);

/// The mode that the key for breath or heart holds: the one of that name; for breath, else the first one that
/// is no heart. Empty where there is none.
std::string breath_of(const LiveBody& body);
std::string heart_of(const LiveBody& body);

/// `Breath held`, `Heart arrested`.
std::string words_of_hold(const std::string& mode);

/// `heart at 75 %`
std::string words_of(const PhaseGate& gate);

/// The traces of a body's modes one below the other, each `height` high and as wide as there is room, with a
/// mark at each exposure. Call within a window of Dear ImGui.
void draw_traces(LiveBody& body, float height);

/// Traces, and what holds modes, changes their speed, and gates exposures. Call once per frame.
void draw_body_panel(Viewer& viewer);

}  // namespace xraycast
