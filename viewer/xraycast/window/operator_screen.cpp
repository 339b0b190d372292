#include "xraycast/window/operator_screen.hpp"

#include "xraycast/base/negative_zero.hpp"
#include "xraycast/window/body_panel.hpp"
#include "xraycast/window/intervention_panel.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <imgui.h>
#include <numbers>
#include <optional>
#include <string>

namespace xraycast {
namespace {

constexpr ImU32 kGround = IM_COL32(15, 17, 20, 255), kCap = IM_COL32(46, 52, 60, 255),
                kBright = IM_COL32(232, 236, 240, 255), kDim = IM_COL32(150, 158, 168, 255),
                kXrays = IM_COL32(255, 196, 60, 255), kHeld = IM_COL32(130, 190, 255, 255),
                kDone = IM_COL32(120, 210, 140, 255), kShade = IM_COL32(0, 0, 0, 170);

float em() { return ImGui::GetFontSize(); }

/// Rows of keys: of a body in motion there are more. The height must not change while a picture is
/// subtracted.
float keys_height(bool has_body) { return (has_body ? 6.5f : 4.6f) * em(); }

/// A part of the window that is not moved.
void begin_part(const char* name, const ImVec2& at, const ImVec2& size) {
  ImGui::SetNextWindowPos(at);
  ImGui::SetNextWindowSize(size);
  ImGui::PushStyleColor(ImGuiCol_WindowBg, kGround);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {em(), 0.7f * em()});
  ImGui::Begin(
      name, nullptr,
      ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoBringToFrontOnFocus);
  ImGui::PopStyleVar(3);
  ImGui::PopStyleColor();
}

// ---- the monitor ----------------------------------------------------------------------------------

void heading(const std::string& words) {
  ImGui::Dummy({0, 0.3f * em()});
  ImGui::PushStyleColor(ImGuiCol_Text, kHeld);
  ImGui::TextUnformatted(words.c_str());
  ImGui::PopStyleColor();
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImGui::GetWindowDrawList()->AddLine(at, {at.x + ImGui::GetContentRegionAvail().x, at.y}, kCap);
  ImGui::Dummy({0, 0.2f * em()});
}

/// A value on the right, before its unit; a large one stands on its name's baseline.
void value(const char* name, const std::string& digits, const char* unit, bool is_large = false) {
  ImFont* const font = ImGui::GetIO().Fonts->Fonts[is_large ? 1 : 0];
  const float drop = font->Ascent - ImGui::GetFont()->Ascent, top = ImGui::GetCursorPosY(),
              units = ImGui::GetWindowContentRegionMax().x - 4.5f * em(), gap = 0.4f * em();
  ImGui::SetCursorPosY(top + drop);
  ImGui::TextDisabled("%s", name);
  ImGui::PushFont(font);
  const float width = ImGui::CalcTextSize(digits.c_str()).x;
  ImGui::SetCursorPos({units - gap - width, top});
  ImGui::TextUnformatted(digits.c_str());
  const float bottom = ImGui::GetCursorPosY();
  ImGui::PopFont();
  ImGui::SetCursorPos({units, top + drop});
  ImGui::TextDisabled("%s", unit);
  ImGui::SetCursorPosY(bottom);
}

/// The same in large digits.
void number(const char* name, const std::string& digits, const char* unit) {
  value(name, digits, unit, true);
}

std::string minutes(double seconds) {
  constexpr double kMinute_s = 60;
  const auto whole = static_cast<int>(seconds / kMinute_s);
  return fmt::format("{}:{:04.1f}", whole, seconds - kMinute_s * whole);
}

void show_lamp(bool is_live) {
  const ImVec2 at = ImGui::GetCursorScreenPos(), size(ImGui::GetContentRegionAvail().x, 2.2f * em());
  const char* const words = is_live ? "X-RAYS ON" : "X-rays off";
  const ImVec2 extent = ImGui::CalcTextSize(words);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled(at, {at.x + size.x, at.y + size.y}, is_live ? kXrays : kCap, 0.2f * em());
  draw.AddText({at.x + (size.x - extent.x) / 2, at.y + (size.y - extent.y) / 2}, is_live ? kGround : kDim,
               words);
  ImGui::Dummy(size);
}

void show_dose(const FluoroscopyConsole& console) {
  const DoseRecord dose = console.dose();
  const Technique technique = console.technique();
  heading("Dose");
  number("air kerma", fmt::format("{:.2f}", dose.air_kerma_mGy), "mGy");
  value("rate", fmt::format("{:.1f}", console.kerma_rate()), "mGy/min");
  value("dose-area product", fmt::format("{:.3f}", dose.dap_Gycm2), "Gy cm²");
  value("tube", fmt::format("{} kVp, {:.2f}", technique.kvp, technique.mas), "mAs");
  heading("Time");
  number("fluoroscopy", minutes(dose.fluoroscopy_s), "min");
  value("images recorded", fmt::format("{}", dose.images), "");
}

void show_run(const Intervention& intervention) {
  const SimulatedRun& run = intervention.run();
  const std::size_t hub = intervention.held_hub();
  const HubPose& pose = run.now().instrument(hub).pose;
  heading("Contrast agent");
  number("injected", fmt::format("{:.0f}", run.injected_ml()), "ml");
  heading("Hub of " + run.models()[hub].name());
  number("inserted", fmt::format("{:.0f}", no_negative_zero(pose.insertion_mm, 0)), "mm");
  value("turned", fmt::format("{:.0f}", no_negative_zero(pose.rotation_rad * 180 / std::numbers::pi, 0)),
        "deg");
  show_loads(run, hub);
}

void show_messages(Viewer& viewer) {
  ImGui::Dummy({0, 0.3f * em()});
  if (const auto status = viewer.status())
    ImGui::ProgressBar(static_cast<float>(status->fraction), {-1, 0}, status->name.c_str());
  ImGui::TextWrapped("%s", viewer.message().c_str());
}

void draw_monitor(Viewer& viewer) {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  begin_part("monitor", {window.x - monitor_width(), 0},
             {monitor_width(), window.y - keys_height(viewer.body() != nullptr)});
  show_lamp(viewer.pedal());
  if (const FluoroscopyConsole* console = viewer.console()) {
    show_dose(*console);
  } else {
    heading("Time");
    number("fluoroscopy", minutes(viewer.intervention()->fluoroscopy_s()), "min");
  }
  if (LiveBody* body = viewer.body()) {
    heading("ECG and breath");
    draw_traces(*body, 2.4f * em());
  }
  show_run(*viewer.intervention());
  show_messages(viewer);
  ImGui::End();
}

// ---- the keys -------------------------------------------------------------------------------------

/// A key's cap; returns its width.
float draw_cap(const ImVec2& at, const std::string& key) {
  const ImVec2 words = ImGui::CalcTextSize(key.c_str());
  const float width = words.x + em();
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled(at, {at.x + width, at.y + 1.5f * em()}, kCap, 0.25f * em());
  draw.AddText({at.x + em() / 2, at.y + 0.25f * em()}, kBright, key.c_str());
  return width;
}

void draw_keys(const std::vector<KeyHint>& keys, float height) {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  begin_part("keys", {0, window.y - height}, {window.x, height});
  const float left = em(), row = 1.9f * em();
  ImVec2 at(left, window.y - height + 0.5f * em());
  for (const KeyHint& hint : keys) {
    const float width = ImGui::CalcTextSize((hint.keys + hint.does).c_str()).x + 1.5f * em();
    if (at.x + width > window.x - left) at = {left, at.y + row};
    const float cap = draw_cap(at, hint.keys);
    ImGui::GetWindowDrawList()->AddText({at.x + cap + 0.5f * em(), at.y + 0.25f * em()}, kDim,
                                        hint.does.c_str());
    at.x += width + 1.2f * em();
  }
  ImGui::End();
}

// ---- in the picture -------------------------------------------------------------------------------

/// Words on a shade, `at` in the middle of their upper edge or, where `is_right`, at their upper right
/// corner.
void draw_label(const ImVec2& at, const std::string& words, ImU32 colour, bool is_right = false) {
  const ImVec2 size = ImGui::CalcTextSize(words.c_str());
  const float pad = 0.5f * em(), left = at.x - (size.x + 2 * pad) * (is_right ? 1 : 0.5f);
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  draw.AddRectFilled({left, at.y}, {left + size.x + 2 * pad, at.y + size.y + pad}, kShade, 0.25f * em());
  draw.AddText({left + pad, at.y + pad / 2}, colour, words.c_str());
}

/// What is not as in a patient who breathes.
void draw_body_state(const LiveBody& body, ImVec2 corner) {
  std::vector<std::string> lines;
  for (const BodyModeState& mode : body.modes())
    if (mode.is_held) lines.push_back(words_of_hold(mode.name));
  if (body.speed() != 1) lines.push_back(fmt::format("Motion {:g} times as fast", body.speed()));
  if (body.gate()) lines.push_back("Gated: " + words_of(*body.gate()));
  for (const std::string& line : lines) {
    draw_label(corner, line, kHeld, true);
    corner.y += 1.8f * em();
  }
}

void draw_picture_state(const Viewer& viewer, const OperatorState& state, const Viewer::Pane& picture) {
  const auto right = static_cast<float>(picture.x + picture.width);
  const ImVec2 corner(right - em(), viewer.is_split ? 2.2f * em() : 0.6f * em());
  if (viewer.is_held()) draw_label(corner, "Last image held: X for live", kHeld, true);
  if (state.is_live) draw_label(corner, "X-rays on", kXrays, true);
  if (const LiveBody* body = viewer.body()) draw_body_state(*body, {corner.x, corner.y + 1.8f * em()});
  ImVec2 middle(static_cast<float>(picture.x) + 0.5f * static_cast<float>(picture.width), 2.6f * em());
  for (const std::string& line : advice_on(state)) {
    draw_label(middle, line, kXrays);
    middle.y += 1.8f * em();
  }
}

// ---- the exercise ---------------------------------------------------------------------------------

/// A disc where it is done, a ring where it is next, else a dot.
void draw_mark(bool is_done, bool is_next) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const ImVec2 middle(at.x + 0.5f * em(), at.y + 0.5f * em());
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  if (is_done)
    draw.AddCircleFilled(middle, 0.32f * em(), kDone);
  else if (is_next)
    draw.AddCircle(middle, 0.32f * em(), kBright, 0, 0.12f * em());
  else
    draw.AddCircleFilled(middle, 0.12f * em(), kDim);
  ImGui::Dummy({em(), em()});
  ImGui::SameLine();
}

void write_in(ImU32 colour, const std::string& words) {
  ImGui::PushStyleColor(ImGuiCol_Text, colour);
  ImGui::TextWrapped("%s", words.c_str());
  ImGui::PopStyleColor();
}

void list_targets(const ExerciseState& state) {
  const std::size_t next = state.reached();
  constexpr std::size_t kMostShown = 8;  // those about the next one
  const std::size_t count = state.targets.size();
  const std::size_t first = count > kMostShown ? std::min(next < 3 ? 0 : next - 3, count - kMostShown) : 0;
  for (std::size_t t = first; t < std::min(count, first + kMostShown); ++t) {
    const ExerciseState::Target& target = state.targets[t];
    draw_mark(target.reached_s.has_value(), t == next);
    write_in(target.reached_s ? kDone
             : t == next      ? kBright
                              : kDim,
             target.reached_s ? fmt::format("{}: {:.1f} s", target.name, *target.reached_s) : target.name);
  }
  if (count > kMostShown) write_in(kDim, fmt::format("{} of {} reached", next, count));
}

int decimals_of(double limit) { return limit < 10 ? 2 : limit < 100 ? 1 : 0; }

/// What was passed or entered, and how far the others are.
void list_limits(const Exercise& exercise, const ExerciseState& state) {
  for (const ExerciseState::Limit& limit : state.limits)
    write_in(limit.passed_s ? kXrays : kDim,
             fmt::format("{} {} of {:g}", words_of_limit(limit.name),
                         limit.value ? fmt::format("{:.{}f}", *limit.value, decimals_of(limit.limit)) : "-",
                         limit.limit));
  std::string forbidden;
  for (const ForbiddenVessel& vessel : exercise.forbidden)
    forbidden += fmt::format("{}{}", forbidden.empty() ? "" : ", ", vessel.name);
  if (!forbidden.empty()) write_in(kDim, "Keep out of: " + forbidden);
  constexpr std::size_t kMostShown = 3;  // the last ones
  const std::size_t count = state.forbidden_entries.size();
  for (std::size_t e = count - std::min(count, kMostShown); e < count; ++e)
    write_in(kXrays, fmt::format("Forbidden: {} entered at {:.1f} s", state.forbidden_entries[e].name,
                                 state.forbidden_entries[e].time_s));
}

/// The task in the upper left corner of the window; in words until the first key.
void draw_exercise(const Viewer& viewer, const Exercise& exercise, const ExerciseState& state) {
  ImGui::SetNextWindowPos({0.6f * em(), 0.6f * em()});
  ImGui::SetNextWindowSizeConstraints({19 * em(), 0}, {19 * em(), 0.85f * ImGui::GetIO().DisplaySize.y});
  ImGui::PushStyleColor(ImGuiCol_WindowBg, kShade);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0);
  ImGui::Begin("exercise", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoInputs |
                   ImGuiWindowFlags_NoBringToFrontOnFocus);
  write_in(kHeld, exercise.title);
  if (viewer.shows_first_steps) write_in(kBright, exercise.task);
  list_targets(state);
  list_limits(exercise, state);
  if (state.is_complete())
    write_in(state.is_passed() ? kDone : kXrays, state.is_passed() ? "Passed" : "Complete, but not passed");
  ImGui::End();
  ImGui::PopStyleVar();
  ImGui::PopStyleColor();
}

/// A ring about the target that is next, with the vessels' outline. The tree lies where the body is at rest.
void draw_target(const Viewer& viewer, const Exercise& exercise, const ExerciseState& state,
                 const Viewer::Pane& picture) {
  if (state.is_complete() || viewer.body()) return;
  const View view = viewer.shown_in(picture);
  const TargetMark mark = mark_of(exercise.targets[state.reached()], *viewer.tree());
  const glm::dvec2 at = pixel_of(view, mark.at_mm),
                   beside = pixel_of(view, mark.at_mm + mark.radius_mm * view.right());
  if (!(at.x >= 0 && at.x < view.width && at.y >= 0 && at.y < view.height)) return;
  const float radius = std::max(0.4f * em(), static_cast<float>(glm::distance(at, beside)));
  const ImVec2 middle(static_cast<float>(picture.x + at.x), static_cast<float>(at.y));
  ImGui::GetBackgroundDrawList()->AddCircle(middle, radius, kDone, 0, 0.15f * em());
}

void draw_first_steps(const OperatorState& state, const Viewer::Pane& picture) {
  std::vector<KeyHint> steps{{"X", "hold it for X-rays: the picture is live while it is down"}};
  if (state.is_steered_by_keys)
    steps.push_back({"↑ ↓ ← →", "advance, withdraw and turn the catheter; with Shift slowly"});
  steps.push_back({"I", "hold it for contrast agent, which shows the vessels"});
  steps.push_back({"H", "lists all keys; A shows all controls. Any key closes this"});
  ImGui::SetNextWindowPos({static_cast<float>(picture.x) + 0.5f * static_cast<float>(picture.width),
                           0.6f * static_cast<float>(picture.height)},  // below a task's words
                          ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("first steps", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoInputs);
  list_keys(steps);
  ImGui::End();
}

void add_body_state(const LiveBody& body, OperatorState& state) {
  const std::string breath = breath_of(body), heart = heart_of(body);
  for (const BodyModeState& mode : body.modes()) {
    if (mode.name == breath) state.has_breath = true, state.holds_breath = mode.is_held;
    if (mode.name == heart) state.has_heart = true, state.holds_heart = mode.is_held;
  }
  state.speed = body.speed();
  if (body.gate()) state.gate = words_of(*body.gate());
  state.opens_gate = body.opens_again();
}

}  // namespace

OperatorState operator_state(const Viewer& viewer) {
  OperatorState state{.is_live = viewer.pedal() && (viewer.intervention() || viewer.console())};
  if (const Intervention* run = viewer.intervention()) {
    state.steers = true;
    state.is_steered_by_keys = run->manual() && run->haptic() != "gamepad";
    state.is_steered_by_mouse = run->manual() && run->haptic() == "mouse";
    state.has_valve = run->run().has_valve();
    state.has_agent_outlet = run->run().now().agent_outlet.has_value();
    state.injects = run->run().injection_ml_s() > 0;
    state.is_recording = run->run().is_recording();
    state.has_recording = viewer.has_recording();
    state.has_exercise = run->exercise() != nullptr;
    state.follows = viewer.follows;
    state.shows_road_map = run->has_road_map();
  }
  if (const FluoroscopyConsole* console = viewer.console()) {
    state.exposes = true;
    state.is_automatic = console->options().is_automatic();
    state.dose = console->options().dose;
    state.subtracts = console->subtracts();
    state.is_masking = console->is_masking();
    state.has_angiogram = console->has_angiogram();
    state.shows_road_map = console->shows_road_map();
  }
  if (const LiveBody* body = viewer.body()) add_body_state(*body, state);
  return state;
}

float monitor_width() { return 21 * em(); }

void list_keys(const std::vector<KeyHint>& keys) {
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {0.5f * em(), 0.1f * em()});
  ImGui::BeginTable("list", 2, ImGuiTableFlags_SizingFixedFit);
  for (const KeyHint& hint : keys) {
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(hint.keys.c_str());
    ImGui::TableNextColumn();
    ImGui::TextDisabled("%s", hint.does.c_str());
  }
  ImGui::EndTable();
  ImGui::PopStyleVar();
}

void draw_operator_screen(Viewer& viewer) {
  const OperatorState state = operator_state(viewer);
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  const Viewer::Pane picture = viewer.panes(static_cast<int>(window.x), static_cast<int>(window.y)).front();
  if (viewer.map()) draw_picture_state(viewer, state, picture);
  if (!state.steers) return;
  if (const Exercise* exercise = viewer.intervention()->exercise()) {
    const std::optional<ExerciseState> progress = viewer.intervention()->run().monitor().state();
    if (viewer.map()) draw_target(viewer, *exercise, *progress, picture);
    if (!viewer.shows_panels) draw_exercise(viewer, *exercise, *progress);
  }
  const float keys = keys_height(viewer.body() != nullptr);
  viewer.reserve(static_cast<int>(monitor_width()), static_cast<int>(keys));
  if (!viewer.shows_panels) draw_monitor(viewer);
  draw_keys(usable_keys(state), keys);
  if (viewer.shows_first_steps && viewer.map()) draw_first_steps(state, picture);
}

}  // namespace xraycast
