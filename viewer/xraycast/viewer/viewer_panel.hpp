#pragma once

#include "xraycast/viewer/opacity_panel.hpp"
#include "xraycast/viewer/viewer.hpp"

#include <string>

namespace xraycast {

/// The viewer's controls and what is written over its picture, by Dear ImGui.
class ViewerPanel {
 public:
  /// Within a frame of Dear ImGui.
  void draw(Viewer& viewer);

  /// Asks for a file to open, in the next frame.
  void ask_for_file() { asks_ = true; }

  /// Whether a key of GLFW that was pressed was meant for the question: Enter or Escape. Dear ImGui itself
  /// misses keys that are pressed and let go within a frame.
  bool takes_key(int key);

 private:
  void look_controls(Viewer& viewer);
  void layer_controls(Viewer& viewer);
  void opacity_controls(Viewer& viewer);
  void file_controls(Viewer& viewer);
  void open_dialogue(Viewer& viewer);

  OpacityPanel curve_;
  std::string file_;
  bool asks_ = false, is_asking_ = false, accepts_ = false, declines_ = false;
};

}  // namespace xraycast
