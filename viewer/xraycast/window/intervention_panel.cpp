#include "xraycast/window/intervention_panel.hpp"

#include "xraycast/haptics/hand_rates.hpp"
#include "xraycast/simulation/agent_outlet.hpp"
#include "xraycast/window/hub_input.hpp"
#include "xraycast/window/viewer_input.hpp"

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
    "Up, Down       advance and withdraw (with Shift: slowly)\n"
    "Left, Right    rotate (torque)\n"
    "Tab            hold the next device (a wire in a catheter)\n"
    "V              valve: lock the devices together or release them\n"
    "Enter          start or stop a recording\n"
    "L              replay the last recording\n"
    "Backspace      restart at the vessel entry";

namespace {

constexpr double kRadians = std::numbers::pi / 180;

/// With Control held, the mouse moves the hub.
void drag_hub(ManualDevice& hand) {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantCaptureMouse || !io.KeyCtrl) return;
  constexpr double kPush_mm_per_pixel = 0.5, kRotate_deg_per_pixel = 1, kPush_mm_per_notch = 3;
  double push_mm = kPush_mm_per_notch * io.MouseWheel, rotate_deg = 0;
  if (is_dragged(ImGuiMouseButton_Left)) {
    push_mm -= kPush_mm_per_pixel * io.MouseDelta.y;
    rotate_deg += kRotate_deg_per_pixel * io.MouseDelta.x;
  }
  hand.move_by(push_mm, kRadians * rotate_deg);
}

void strip(const char* name, const SimulatedRun& run, std::size_t hub, double HubLoad::*load, double scale,
           const char* unit) {
  std::vector<float> values;
  for (const SimulatedRun::Load& at : run.loads())
    values.push_back(static_cast<float>(scale * (at.hubs[hub].*load)));
  float largest = 0.1f;
  for (const float value : values) largest = std::max(largest, std::abs(value));
  const std::string now = fmt::format("{} {:+.2f} {}", name, values.empty() ? 0.0f : values.back(), unit);
  ImGui::PlotLines(fmt::format("##{}{}", name, hub).c_str(), values.data(), static_cast<int>(values.size()),
                   0, now.c_str(), -largest, largest, {25 * ImGui::GetFontSize(), 4 * ImGui::GetFontSize()});
}

/// Over a network every hub is moved, and one leads while the valve is locked.
const char* note_on_hand(const SimulatedRun& run, std::size_t number, bool is_manual) {
  if (!run.has_valve() || number != run.held_hub()) return "";
  if (is_manual) return ", in the hand (Tab: next)";
  return run.is_valve_locked() ? ", leads (Tab: next)" : "";
}

void show_device(const SimulatedRun& run, std::size_t number, bool is_manual) {
  const DeviceSnapshot& device = run.now().device(number);
  const auto line = [](const std::string& text) { ImGui::TextWrapped("%s", text.c_str()); };
  line(run.models()[number].name() + note_on_hand(run, number, is_manual));
  line(fmt::format("inserted {:.1f} mm, rotated {:.0f} deg", device.pose.insertion_mm,
                   device.pose.rotation_rad / kRadians));
  line(fmt::format("tip: branch {}, at {:.0f} mm", device.tip.branch, device.tip.arc_length_mm));
  strip("force", run, number, &HubLoad::force_N, 1, "N");
  strip("torque", run, number, &HubLoad::torque_Nm, 1000, "N mm");
}

}  // namespace

void handle_held_input(Viewer& viewer, GLFWwindow* window) {
  const bool types = ImGui::GetIO().WantTextInput;
  const HubInput keys = held_keys([&](int key) { return !types && glfwGetKey(window, key) == GLFW_PRESS; });
  const auto pad_state = connected_pad();
  const HubInput pad = pad_state ? held_pad(*pad_state) : HubInput{};
  viewer.press_pedal(keys.pedal || pad.pedal);
  Intervention* intervention = viewer.intervention();
  if (!intervention) return;
  intervention->run().inject(keys.injects || pad.injects ? kInjection_ml_s : 0);

  ManualDevice* hand = intervention->manual();
  if (!hand) return;
  if (intervention->haptic() == "mouse") drag_hub(*hand);
  const HubInput& held = intervention->haptic() == "gamepad" && pad_state ? pad : keys;
  hand->set_rates(held.insertion_mm_s, held.rotation_rad_s);
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
  const auto line = [](const std::string& text) { ImGui::TextWrapped("%s", text.c_str()); };
  line(fmt::format("hub input: {}", intervention->run().device().status()));
  for (std::size_t d = 0; d < now.count(); ++d) show_device(run, d, intervention->manual() != nullptr);
  if (run.has_valve()) {
    bool is_locked = run.is_valve_locked();
    if (ImGui::Checkbox("valve locked", &is_locked)) intervention->run().lock_valve(is_locked);
  }
  const auto minutes = static_cast<int>(intervention->fluoroscopy_s() / 60);
  line(fmt::format("fluoro time {}:{:04.1f} min, contrast agent {:.0f} ml", minutes,
                   intervention->fluoroscopy_s() - 60 * minutes, run.injected_ml()));
  if (!now.agent_outlet) line(fmt::format("no contrast agent: {}", reason_for_no_outlet(run.models())));
  line(intervention->is_live() ? "X-rays on" : "last image hold: hold X for fluoroscopy");
  ImGui::Checkbox("road map", &intervention->has_road_map);
  const LoopTiming& timing = now.timing;
  line(fmt::format("step {:.2f} ms, p99.9 {:.2f} ms, {:.2f} % late", timing.mean_ms, timing.p999_ms,
                   100.0 * static_cast<double>(timing.missed) /
                       static_cast<double>(std::max<std::int64_t>(1, timing.steps))));
  if (ImGui::Button("Restart")) viewer.restart_run();
  ImGui::SameLine();
  if (ImGui::Button(run.is_recording() ? "Stop recording" : "Record")) viewer.toggle_recording();
  ImGui::SameLine();
  if (ImGui::Button("Replay")) viewer.replay();
  ImGui::End();
}

}  // namespace xraycast
