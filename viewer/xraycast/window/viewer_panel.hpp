#pragma once

#include "xraycast/window/opacity_panel.hpp"
#include "xraycast/window/viewer.hpp"

#include <string>

namespace xraycast {

/// The viewer's controls and what is written over its picture, by Dear ImGui.
class ViewerPanel {
 public:
  /// Within a frame of Dear ImGui.
  void draw(Viewer& viewer);

  /// Asks for a file to open, in the next frame.
  void ask_for_file() { asks_ = true; }

  /// Whether a key of GLFW that was pressed is the panel's, as text or as an answer to the question: Dear
  /// ImGui itself misses an Enter or Escape that is pressed and let go within a frame.
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
  bool has_asked_ = false;  ///< for two frames more Dear ImGui takes keys for the question's text
};

}  // namespace xraycast
