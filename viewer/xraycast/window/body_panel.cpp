#include "xraycast/window/body_panel.hpp"

#include "xraycast/window/exposure_panel.hpp"
#include "xraycast/window/operator_screen.hpp"

#include <fmt/format.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <imgui.h>
#include <vector>

namespace xraycast {

namespace {

constexpr ImU32 kTraceGround = IM_COL32(10, 12, 14, 255), kMark = IM_COL32(255, 196, 60, 255),
                kName = IM_COL32(150, 158, 168, 255);
/// An ECG is green on most monitors, a breath blue.
constexpr ImU32 kEcg = IM_COL32(90, 220, 120, 255), kBreath = IM_COL32(110, 190, 250, 255);

constexpr double kSlowest = 0.125, kFastest = 8;

/// The gate that the key sets: late in the beat, where a heart rests.
PhaseGate usual_gate(const LiveBody& body) {
  constexpr double kRest = 0.75;
  const std::string heart = heart_of(body);
  return heart.empty() ? PhaseGate{breath_of(body), 0} : PhaseGate{heart, kRest};
}

void set_speed(LiveBody& body, double factor) {
  body.change({.speed = std::clamp(factor, kSlowest, kFastest)});
}

void toggle_gate(LiveBody& body) {
  BodyChanges changes;
  changes.gate = body.gate() ? std::nullopt : std::optional(usual_gate(body));
  body.change(changes);
}

void toggle_mode(Viewer& viewer, const std::string& mode) {
  if (!mode.empty()) viewer.attempt([&] { viewer.body()->toggle_hold(mode); });
}

void draw_trace(const std::deque<float>& samples, ImU32 colour, const ImVec2& at, const ImVec2& size) {
  constexpr auto kMost = static_cast<float>(BodyTraces::kKept_s / BodyTraces::kStep_s);
  const float edge = 0.08f * size.y;
  std::vector<ImVec2> points;
  const auto empty = static_cast<std::size_t>(kMost) - samples.size();
  for (std::size_t i = 0; i < samples.size(); ++i)
    points.emplace_back(at.x + size.x * static_cast<float>(empty + i) / kMost,
                        at.y + size.y - edge - samples[i] * (size.y - 2 * edge));
  ImGui::GetWindowDrawList()->AddPolyline(points.data(), static_cast<int>(points.size()), colour, 0, 1.3f);
}

void draw_marks(const BodyTraces& traces, const ImVec2& at, const ImVec2& size) {
  for (const double time_s : traces.exposures_s) {
    const auto age = static_cast<float>((traces.end_s - time_s) / BodyTraces::kKept_s);
    const float x = at.x + std::round(size.x * (1 - std::clamp(age, 0.0f, 1.0f)));
    ImGui::GetWindowDrawList()->AddRectFilled({x - 1, at.y + 0.78f * size.y}, {x, at.y + size.y}, kMark);
  }
}

void choose_gate(LiveBody& body) {
  const auto& gate = body.gate();
  if (ImGui::BeginCombo("gate", gate ? gate->mode.c_str() : "none")) {
    BodyChanges changes;
    if (ImGui::Selectable("none", !gate)) changes.gate.emplace();
    for (const BodyModeState& mode : body.modes()) {
      const PhaseGate usual = usual_gate(body);
      if (ImGui::Selectable(mode.name.c_str(), gate && gate->mode == mode.name))
        changes.gate = PhaseGate{mode.name, mode.name == usual.mode ? usual.phase : 0};
    }
    ImGui::EndCombo();
    if (!changes.is_empty()) body.change(changes);
  }
  if (!body.gate()) return;
  auto percent = static_cast<float>(100 * body.gate()->phase);
  if (ImGui::SliderFloat("at phase", &percent, 0, 100, "%.0f %%", ImGuiSliderFlags_AlwaysClamp))
    body.change({.gate = PhaseGate{body.gate()->mode, percent / 100}});
}

void show_mode(LiveBody& body, const BodyModeState& mode) {
  bool is_held = mode.is_held;
  if (ImGui::Checkbox(fmt::format("hold {}", mode.name).c_str(), &is_held)) body.toggle_hold(mode.name);
  if (!mode.is_held) return;
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-1);
  auto percent = static_cast<float>(100 * mode.phase);
  if (ImGui::SliderFloat(fmt::format("##{}", mode.name).c_str(), &percent, 0, 100, "at %.0f %%",
                         ImGuiSliderFlags_AlwaysClamp))
    body.change({.holds = {{mode.name, {.phase = percent / 100}}}});
}

}  // namespace

std::string breath_of(const LiveBody& body) {
  std::string other;
  for (const BodyModeState& mode : body.modes()) {
    if (mode.name == "breath") return mode.name;
    if (other.empty() && mode.name != "heart") other = mode.name;
  }
  return other;
}

std::string heart_of(const LiveBody& body) {
  for (const BodyModeState& mode : body.modes())
    if (mode.name == "heart") return mode.name;
  return {};
}

std::string words_of_hold(const std::string& mode) {
  if (mode == "heart") return "Heart arrested";
  std::string words = mode + " held";
  words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
  return words;
}

std::string words_of(const PhaseGate& gate) {
  return fmt::format("{} at {:.0f} %", gate.mode, 100 * gate.phase);
}

bool handle_body_key(Viewer& viewer, int key) {
  LiveBody* const body = viewer.body();
  if (!body) return false;
  switch (key) {
    case GLFW_KEY_B:
      toggle_mode(viewer, breath_of(*body));
      return true;
    case GLFW_KEY_K:
      toggle_mode(viewer, heart_of(*body));
      return true;
    case GLFW_KEY_W:
      viewer.attempt([&] { toggle_gate(*body); });
      return true;
    case GLFW_KEY_COMMA:
      set_speed(*body, body->speed() / 2);
      return true;
    case GLFW_KEY_PERIOD:
      set_speed(*body, body->speed() * 2);
      return true;
    default:
      return false;
  }
}

void draw_traces(LiveBody& body, float height) {
  const BodyTraces& traces = body.traces();
  const std::vector<BodyModeState> modes = body.modes();
  const float gap = 0.2f * ImGui::GetFontSize();
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const ImVec2 at = ImGui::GetCursorScreenPos(), size(ImGui::GetContentRegionAvail().x, height);
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    const bool is_heart = modes[m].name == "heart";
    draw.AddRectFilled(at, {at.x + size.x, at.y + size.y}, kTraceGround);
    draw_marks(traces, at, size);
    draw_trace(traces.samples[m], is_heart ? kEcg : kBreath, at, size);
    const std::string name = (is_heart ? "ECG" : modes[m].name) + (modes[m].is_held ? ", held" : "");
    draw.AddText({at.x + gap, at.y}, kName, name.c_str());
    ImGui::Dummy({size.x, size.y + gap - ImGui::GetStyle().ItemSpacing.y});
  }
}

void draw_body_panel(Viewer& viewer) {
  LiveBody* const body = viewer.body();
  if (!body) return;
  const float em = ImGui::GetFontSize(), width = 21 * em;
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  // Beside the exposure's panel where a catheter is steered, else below it.
  ImGui::SetNextWindowPos(viewer.intervention() ? ImVec2(27 * em + 16, exposure_panel_top(viewer))
                                                : ImVec2(size.x - width - 8, size.y - 20 * em),
                          ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSizeConstraints({width, 0}, {width, size.y});
  ImGui::Begin("body", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  draw_traces(*body, 2.6f * em);
  viewer.attempt([&] {
    for (const BodyModeState& mode : body->modes()) show_mode(*body, mode);
    auto speed = static_cast<float>(body->speed());
    if (ImGui::SliderFloat("speed", &speed, static_cast<float>(kSlowest), static_cast<float>(kFastest),
                           "%.2f x", ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp))
      set_speed(*body, speed);
    choose_gate(*body);
  });
  ImGui::End();
}

}  // namespace xraycast
