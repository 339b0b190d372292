#pragma once

#include "xraycast/window/opacity_panel.hpp"
#include "xraycast/window/viewer.hpp"

#include <string>

namespace xraycast {

/// The viewer's controls, and the text and marks over its picture, by Dear ImGui.
class ViewerPanel {
 public:
  /// Call within a frame of Dear ImGui.
  void draw(Viewer& viewer);

  /// Shows the file dialogue from the next frame on.
  void ask_for_file() { asks_ = true; }

  /// Whether a pressed key (GLFW's number) belongs to the panel, as text or as an answer to the dialogue:
  /// Dear ImGui itself misses an Enter or Escape that is pressed and released within a frame.
  bool takes_key(int key);

 private:
  void style_controls(Viewer& viewer);
  void layer_controls(Viewer& viewer);
  void opacity_controls(Viewer& viewer);
  void file_controls(Viewer& viewer);
  void open_dialogue(Viewer& viewer);

  OpacityPanel curve_;
  std::string file_;
  bool asks_ = false, is_asking_ = false, accepts_ = false, declines_ = false;
  bool has_asked_ = false;  ///< Dear ImGui takes keys as the dialogue's text for two more frames
};

}  // namespace xraycast
