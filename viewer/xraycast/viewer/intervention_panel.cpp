#include "xraycast/viewer/intervention_panel.hpp"

#include <fmt/format.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <cfloat>
#include <imgui.h>
#include <numbers>
#include <vector>

namespace xraycast {

const char* const kInterventionHelp =
    "X (hold)       pedal: fluoroscopy\n"
    "I (hold)       inject contrast agent\n"
    "M              road map\n"
    "Up, Down       push and pull (with Shift slowly)\n"
    "Left, Right    rotate";

namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kPush_mm_s = 40, kRotate_deg_s = 120, kInjection_ml_s = 5;

struct Rates {
  double insertion_mm_s = 0, rotation_deg_s = 0;
};

Rates held_keys(GLFWwindow* window) {
  const auto is_down = [window](int key) { return glfwGetKey(window, key) == GLFW_PRESS ? 1.0 : 0.0; };
  const double slowly = is_down(GLFW_KEY_LEFT_SHIFT) + is_down(GLFW_KEY_RIGHT_SHIFT) > 0 ? 0.2 : 1;
  return {slowly * kPush_mm_s * (is_down(GLFW_KEY_UP) - is_down(GLFW_KEY_DOWN)),
          slowly * kRotate_deg_s * (is_down(GLFW_KEY_RIGHT) - is_down(GLFW_KEY_LEFT))};
}

/// The left stick; small deflections are none.
Rates held_stick(const GLFWgamepadstate& pad) {
  const auto axis = [&pad](int index) {
    constexpr double kDead = 0.15;
    const double value = pad.axes[index];
    return std::abs(value) < kDead ? 0.0 : value;
  };
  return {-kPush_mm_s * axis(GLFW_GAMEPAD_AXIS_LEFT_Y), kRotate_deg_s * axis(GLFW_GAMEPAD_AXIS_LEFT_X)};
}

/// With Control held, the mouse holds the hub.
void drag_hub(ManualDevice& hand) {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantCaptureMouse || !io.KeyCtrl) return;
  constexpr double kPush_mm_per_pixel = 0.5, kRotate_deg_per_pixel = 1, kPush_mm_per_notch = 3;
  double push_mm = kPush_mm_per_notch * io.MouseWheel, rotate_deg = 0;
  if (ImGui::IsMouseDragging(ImGuiMouseButton_Left, 0)) {
    push_mm -= kPush_mm_per_pixel * io.MouseDelta.y;
    rotate_deg += kRotate_deg_per_pixel * io.MouseDelta.x;
  }
  hand.move_by(push_mm, kRadians * rotate_deg);
}

void strip(const char* name, const SimulatedRun& run, double HubLoad::*load, double scale, const char* unit) {
  std::vector<float> values;
  for (const SimulatedRun::Load& at : run.loads())
    values.push_back(static_cast<float>(scale * (at.load.*load)));
  float largest = 0.1f;
  for (const float value : values) largest = std::max(largest, std::abs(value));
  const std::string now = fmt::format("{} {:+.2f} {}", name, values.empty() ? 0.0f : values.back(), unit);
  ImGui::PlotLines(fmt::format("##{}", name).c_str(), values.data(), static_cast<int>(values.size()), 0,
                   now.c_str(), -largest, largest, {25 * ImGui::GetFontSize(), 4 * ImGui::GetFontSize()});
}

}  // namespace

void handle_intervention(Viewer& viewer, GLFWwindow* window) {
  Intervention* intervention = viewer.intervention();
  if (!intervention) return;
  const bool types = ImGui::GetIO().WantTextInput;
  const auto is_down = [&](int key) { return !types && glfwGetKey(window, key) == GLFW_PRESS; };
  GLFWgamepadstate pad{};
  const bool has_pad = glfwGetGamepadState(GLFW_JOYSTICK_1, &pad) == GLFW_TRUE;
  const auto is_pressed = [&](int button) { return has_pad && pad.buttons[button] == GLFW_PRESS; };
  intervention->press_pedal(is_down(GLFW_KEY_X) || is_pressed(GLFW_GAMEPAD_BUTTON_A));
  const bool injects = is_down(GLFW_KEY_I) || is_pressed(GLFW_GAMEPAD_BUTTON_B);
  intervention->run().inject(injects ? kInjection_ml_s : 0);

  ManualDevice* hand = intervention->manual();
  if (!hand) return;
  if (intervention->haptic() == "mouse") drag_hub(*hand);
  const bool by_pad = intervention->haptic() == "gamepad" && has_pad;
  const Rates rates = by_pad ? held_stick(pad) : types ? Rates{} : held_keys(window);
  hand->set_rates(rates.insertion_mm_s, kRadians * rates.rotation_deg_s);
}

void draw_intervention_panel(Viewer& viewer) {
  Intervention* intervention = viewer.intervention();
  if (!intervention) return;
  const SimulatedRun& run = intervention->run();
  const CatheterSnapshot& now = run.now();
  const float width = 27 * ImGui::GetFontSize();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x - width - 8, 3 * ImGui::GetFontSize()}, ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSizeConstraints({width, 0}, {width, FLT_MAX});
  ImGui::Begin("catheter", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  const auto line = [](const std::string& text) { ImGui::TextUnformatted(text.c_str()); };
  line(fmt::format("{}, held by {}", run.model().name(), intervention->run().device().status()));
  line(fmt::format("in {:.1f} mm, turned {:.0f} deg", now.pose.insertion_mm,
                   now.pose.rotation_rad / kRadians));
  line(fmt::format("tip in branch {}, {:.0f} mm deep", now.tip.branch, now.tip.arc_length_mm));
  strip("force", run, &HubLoad::force_N, 1, "N");
  strip("torque", run, &HubLoad::torque_Nm, 1000, "N mm");
  const auto minutes = static_cast<int>(intervention->fluoroscopy_s() / 60);
  line(fmt::format("fluoroscopy {}:{:04.1f} min, contrast {:.0f} ml", minutes,
                   intervention->fluoroscopy_s() - 60 * minutes, run.injected_ml()));
  line(intervention->is_live() ? "X-rays on" : "last image hold: press X");
  ImGui::Checkbox("road map", &intervention->has_road_map);
  const LoopTiming& timing = now.timing;
  line(fmt::format("step {:.2f} ms, 99.9 % {:.2f} ms, {:.2f} % late", timing.mean_ms, timing.p999_ms,
                   100.0 * static_cast<double>(timing.missed) /
                       static_cast<double>(std::max<std::int64_t>(1, timing.steps))));
  if (ImGui::Button("Restart")) viewer.attempt([&] { intervention->restart(); });
  ImGui::SameLine();
  if (ImGui::Button(run.is_recording() ? "Stop recording" : "Record")) viewer.toggle_recording();
  ImGui::SameLine();
  if (ImGui::Button("Replay")) viewer.replay();
  ImGui::End();
}

}  // namespace xraycast
