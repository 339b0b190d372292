#include "xraycast/window/viewer_input.hpp"

#include "xraycast/window/body_panel.hpp"
#include "xraycast/window/exposure_panel.hpp"
#include "xraycast/window/hub_input.hpp"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <cmath>
#include <imgui.h>

namespace xraycast {
namespace {

constexpr double kDegreesPerPixel = 0.4;

/// The left button was released where it was pressed, up to small hand motions.
bool is_clicked() {
  constexpr float kStill_px = 3;
  return ImGui::IsMouseReleased(ImGuiMouseButton_Left) &&
         ImGui::GetIO().MouseDragMaxDistanceSqr[ImGuiMouseButton_Left] < kStill_px * kStill_px;
}

/// Dragging across changes the window's width, down its level.
void drag_window(GreyWindow& window, double across, double down) {
  const double middle = 0.5 * (window.dark + window.light) + 0.001 * down;
  const double half = std::max(0.01, 0.5 * (window.light - window.dark) * std::exp(0.005 * across));
  window.dark = std::clamp(middle - half, 0.0, 0.98);
  window.light = std::clamp(middle + half, window.dark + 0.02, 1.0);
}

}  // namespace

std::vector<KeyHint> general_keys(const Viewer& viewer) {
  std::vector<KeyHint> keys{{"left drag", "rotate the C-arm (with Shift also tilt)"},
                            {"left click", "identify a vessel branch"},
                            {"wheel", "zoom"},
                            {"middle drag", "move the table"},
                            {"right drag", "window and level"},
                            {"R", "reset"},
                            {"1 .. 9", "show or hide a layer"},
                            {"F", "look: fluoro, surface"},
                            {"C", "compositing: path, wall, true projection"},
                            {"S", "split view with the true projection"},
                            {"Space", "cine rotation"},
                            {"Ctrl+O", "open"},
                            {"Escape", "cancel reading or casting"},
                            {"Ctrl+S", "save the session"},
                            {"Ctrl+Z, Ctrl+Y", "undo, redo"}};
  if (!viewer.intervention()) keys.push_back({"I", "invert"});
  if (viewer.intervention()) keys.push_back({"Ctrl+R", "save the run's report"});
  return keys;
}

bool is_dragged(int button) { return ImGui::IsMouseDragging(button, 0) && !ImGui::IsMouseClicked(button); }

void handle_mouse(Viewer& viewer) {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantCaptureMouse || !viewer.map()) return;
  CArmPose& pose = viewer.pose();
  const bool holds_hub = viewer.intervention() && viewer.intervention()->haptic() == "mouse" && io.KeyCtrl;
  if (holds_hub) return;
  if (is_dragged(ImGuiMouseButton_Left)) {
    pose.rotate(-kDegreesPerPixel * io.MouseDelta.x);
    if (io.KeyShift || viewer.map()->geometry.ray_layout == RayLayout::sphere)
      pose.tilt(kDegreesPerPixel * io.MouseDelta.y);
  }
  if (is_clicked()) viewer.pick({io.MousePos.x, io.MousePos.y}, io.DisplaySize.x, io.DisplaySize.y);
  if (is_dragged(ImGuiMouseButton_Middle)) {
    const Viewer::Pane pane =
        viewer.panes(static_cast<int>(io.DisplaySize.x), static_cast<int>(io.DisplaySize.y)).front();
    const View view = viewer.view_in(pane.width, pane.height);
    pose.travel(io.MouseDelta.y * view.pixel_mm, viewer.bounds());
  }
  if (is_dragged(ImGuiMouseButton_Right)) {
    drag_window(viewer.style().window, io.MouseDelta.x, io.MouseDelta.y);
    viewer.session().has_window = true;
  }
  if (io.MouseWheel != 0) pose.magnify(std::pow(1.1, io.MouseWheel));
}

bool handle_key(Viewer& viewer, int key, int mods) {
  Style& style = viewer.style();
  if (!is_held_down(key)) viewer.clear_message();
  if ((mods & GLFW_MOD_CONTROL) != 0) {
    if (key == GLFW_KEY_Z) viewer.attempt([&] { viewer.opacity().undo(); });
    if (key == GLFW_KEY_Y) viewer.attempt([&] { viewer.opacity().redo(); });
    if (key == GLFW_KEY_S) viewer.save_session();
    if (key == GLFW_KEY_R && viewer.intervention()) viewer.save_report();
    return key == GLFW_KEY_O;
  }
  if (key >= GLFW_KEY_1 && key <= GLFW_KEY_9)
    viewer.opacity().toggle_layer(static_cast<std::size_t>(key - GLFW_KEY_1));
  if (handle_console_key(viewer, key) || handle_body_key(viewer, key)) return false;
  switch (key) {
    case GLFW_KEY_ESCAPE:
      viewer.cancel();
      break;
    case GLFW_KEY_R:
      viewer.reset_view();
      break;
    case GLFW_KEY_A:
      viewer.shows_panels = !viewer.shows_panels;
      break;
    case GLFW_KEY_T:
      viewer.follows = !viewer.follows;
      break;
    case GLFW_KEY_F:
      viewer.set_look(style.look == Look::fluoro ? Look::surface : Look::fluoro);
      break;
    case GLFW_KEY_C:
      viewer.next_source();
      break;
    case GLFW_KEY_I:  // with a catheter it injects
      if (!viewer.intervention()) style.window.inverted = !style.window.inverted;
      break;
    case GLFW_KEY_M:
      if (Intervention* at_table = viewer.intervention()) at_table->show_road_map(!at_table->has_road_map());
      break;
    case GLFW_KEY_ENTER:
    case GLFW_KEY_KP_ENTER:
      if (viewer.intervention()) viewer.toggle_recording();
      break;
    case GLFW_KEY_TAB:
      if (viewer.intervention()) viewer.intervention()->hold_next_hub();
      break;
    case GLFW_KEY_V:
      if (viewer.intervention()) viewer.intervention()->toggle_valve();
      break;
    case GLFW_KEY_L:
      if (viewer.intervention()) viewer.replay();
      break;
    case GLFW_KEY_BACKSPACE:
      if (viewer.intervention()) viewer.restart_run();
      break;
    case GLFW_KEY_S:
      viewer.is_split = !viewer.is_split;
      break;
    case GLFW_KEY_P:
      viewer.save_picture();
      break;
    case GLFW_KEY_SPACE:
      viewer.is_rotating = !viewer.is_rotating;
      break;
    case GLFW_KEY_H:
    case GLFW_KEY_SLASH:
      viewer.shows_help = !viewer.shows_help;
      break;
    default:
      break;
  }
  return false;
}

}  // namespace xraycast
