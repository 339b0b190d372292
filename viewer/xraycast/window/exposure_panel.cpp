#include "xraycast/window/exposure_panel.hpp"

#include "xraycast/fluoroscope/exposure.hpp"

#include <fmt/format.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <array>
#include <cfloat>
#include <imgui.h>
#include <string>

namespace xraycast {

namespace {

constexpr std::array kRates{3.0, 7.5, 15.0, 30.0};

void write_line(const std::string& text) { ImGui::TextUnformatted(text.c_str()); }

void settings(FluoroscopyConsole& console) {
  FluoroscopyOptions options = console.options();
  bool is_other = false;
  if (ImGui::BeginCombo("C-arm", options.c_arm.name.c_str())) {
    for (const std::string& name : CArm::preset_names())
      if (ImGui::Selectable(name.c_str(), name == options.c_arm.name) && name != options.c_arm.name) {
        options.c_arm = CArm::named(name);
        options.field_mm = options.c_arm.fields_mm.front();
        is_other = true;
      }
    ImGui::EndCombo();
  }
  for (const double rate : kRates) {
    if (ImGui::RadioButton(fmt::format("{:g}/s", rate).c_str(), rate == options.pulses_per_s)) {
      options.pulses_per_s = rate;
      is_other = true;
    }
    ImGui::SameLine();
  }
  ImGui::NewLine();
  auto compression = static_cast<float>(options.range_compression());
  ImGui::SliderFloat("compression", &compression, 0, 1, "%.1f");
  if (ImGui::IsItemDeactivatedAfterEdit()) console.compress(compression);
  if (is_other) console.set(options);
  if (ImGui::Button(fmt::format("dose: {}###dose", to_string(options.dose)).c_str())) console.next_dose();
}

void technique_and_dose(const FluoroscopyConsole& console) {
  const Technique technique = console.technique();
  const FluoroscopyOptions& options = console.options();
  const char* const control = !options.is_automatic() ? "manual"
                              : console.is_locked()   ? "locked by DSA"
                                                      : "automatic exposure";
  write_line(fmt::format("{} kVp, {:.3g} mAs per pulse ({}{})", technique.kvp, technique.mas, control,
                         console.is_saturated() ? "; detector saturated" : ""));
  const DoseRecord dose = console.dose();
  write_line(fmt::format("reference air kerma {:.3g} mGy, {:.3g} mGy/min", dose.air_kerma_mGy,
                         console.kerma_rate()));
  write_line(fmt::format("dose-area product {:.3g} Gy cm2", dose.dap_Gycm2));
  constexpr double kMinute_s = 60;
  const auto minutes = static_cast<int>(dose.fluoroscopy_s / kMinute_s);
  write_line(fmt::format("fluoroscopy {}:{:04.1f} min, images recorded {}", minutes,
                         dose.fluoroscopy_s - kMinute_s * minutes, dose.images));
}

void subtraction(Viewer& viewer, FluoroscopyConsole& console) {
  bool subtracts = console.subtracts();
  if (ImGui::Checkbox("DSA", &subtracts)) console.subtract(subtracts);
  ImGui::SameLine();
  ImGui::Checkbox("max. opacification", &console.shows_maximum_opacification);
  ImGui::SameLine();
  bool shows = console.shows_road_map();
  if (ImGui::Checkbox("road map", &shows)) viewer.toggle_console_road_map();
  if (viewer.can_match_masks()) {
    bool matches = console.mask_matching().has_value();
    if (ImGui::Checkbox("masks of the heart's phases", &matches))
      viewer.match_masks(matches ? std::optional(MaskPhase{}) : std::nullopt);
  }
  if (subtracts) {
    PixelShift shift = console.mask_shift();
    constexpr float kMost_px = 5;
    std::array<float, 2> pixels{static_cast<float>(shift.right), static_cast<float>(shift.down)};
    if (ImGui::SliderFloat2("pixel shift", pixels.data(), -kMost_px, kMost_px, "%.1f px"))
      console.shift_mask({pixels[0], pixels[1]});
    auto black = static_cast<float>(console.window.black);
    constexpr float kLeast = 0.02f, kMost = 2;
    if (ImGui::SliderFloat("contrast", &black, kLeast, kMost)) console.window.black = black;
  }
  if (ImGui::Button("New mask")) console.take_new_mask();
  ImGui::SameLine();
  if (ImGui::Button("Store image")) viewer.save_picture();
  ImGui::SameLine();
  write_line(console.is_masking() ? "mask: hold X" : viewer.pedal() ? "X-rays on" : "image held: hold X");
}

}  // namespace

bool handle_console_key(Viewer& viewer, int key) {
  if (key == GLFW_KEY_E) {
    viewer.toggle_console();
    return true;
  }
  FluoroscopyConsole* const console = viewer.console();
  if (!console) return false;
  switch (key) {
    case GLFW_KEY_D:
      console->next_dose();
      return true;
    case GLFW_KEY_G:
      viewer.attempt([&] { console->subtract(!console->subtracts()); });
      return true;
    case GLFW_KEY_N:
      console->take_new_mask();
      return true;
    case GLFW_KEY_M:
      viewer.toggle_console_road_map();
      return true;
    default:
      return false;
  }
}

float exposure_panel_top(const Viewer& viewer) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const int height = viewer.panes(static_cast<int>(size.x), static_cast<int>(size.y)).front().height;
  const float line = ImGui::GetFontSize();
  constexpr float kHighest = 19, kStatus = 2, kLeast = 12;  // in lines; the highest is that of DSA
  return std::max(kLeast * line, static_cast<float>(height) - (kHighest + kStatus) * line);
}

void draw_exposure_panel(Viewer& viewer) {
  FluoroscopyConsole* const console = viewer.console();
  if (!console) return;
  const float width = 27 * ImGui::GetFontSize();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  // The catheter's panel is on the right.
  ImGui::SetNextWindowPos(viewer.intervention() ? ImVec2(8, exposure_panel_top(viewer))
                                                : ImVec2(size.x - width - 8, 3 * ImGui::GetFontSize()),
                          ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSizeConstraints({width, 0}, {width, FLT_MAX});
  ImGui::Begin("exposure", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  viewer.attempt([&] {
    settings(*console);
    technique_and_dose(*console);
    subtraction(viewer, *console);
  });
  ImGui::End();
}

}  // namespace xraycast
