#include "xraycast/window/viewer_panel.hpp"

#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/annotations.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/scene/vessel_pick.hpp"
#include "xraycast/window/exposure_panel.hpp"
#include "xraycast/window/operator_screen.hpp"
#include "xraycast/window/viewer_input.hpp"

#include <fmt/format.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <cfloat>
#include <cmath>
#include <imgui.h>
#include <imgui_stdlib.h>
#include <iterator>
#include <numbers>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr ImU32 kInk = IM_COL32(255, 210, 90, 255);

/// Text that can be read on any grey; (x, y) is its upper left corner.
void write(float x, float y, const std::string& words) {
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  draw.AddText({x + 1, y + 1}, IM_COL32(0, 0, 0, 255), words.c_str());
  draw.AddText({x, y}, kInk, words.c_str());
}

float width_of(const std::string& words) { return ImGui::CalcTextSize(words.c_str()).x; }

/// Puts the next button beside the last one if there is room for it.
void continue_row_if_fits(const char* next) {
  const ImGuiStyle& style = ImGui::GetStyle();
  const float end =
      ImGui::GetItemRectMax().x + style.ItemSpacing.x + width_of(next) + 2 * style.FramePadding.x;
  if (end < ImGui::GetWindowPos().x + ImGui::GetWindowContentRegionMax().x) ImGui::SameLine();
}

/// Orientation letters, axis and scale bar.
void annotate(const Viewer& viewer, const Viewer::Pane& pane) {
  const View view = viewer.shown_in(pane);
  const auto left = static_cast<float>(pane.x), width = static_cast<float>(pane.width),
             height = static_cast<float>(pane.height);
  const glm::dvec3 half(0, 0, viewer.bounds().half_height_mm);
  const Annotations annotations =
      annotations_of(view, viewer.bounds().centre_mm + half, viewer.bounds().centre_mm - half);
  const float line = ImGui::GetFontSize(), right = left + width - line, y = height - 3 * line;
  write(left + line, height / 2, annotations.left);
  write(right - width_of(annotations.right), height / 2, annotations.right);
  write(left + width / 2 + line / 2, line / 2, annotations.top);
  write(left + width / 2 + line / 2, height - 2.6f * line, annotations.bottom);
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  const auto bar = static_cast<float>(annotations.bar_px);
  draw.AddLine({right - bar, y}, {right, y}, kInk, 2);
  for (const float end : {right - bar, right}) draw.AddLine({end, y - 4}, {end, y + 4}, kInk, 2);
  const std::string length = fmt::format("{:g} mm", annotations.bar_mm);
  write(right - width_of(length), y - 1.4f * line, length);
  const glm::vec2 top(annotations.axis_top), bottom(annotations.axis_bottom);
  draw.AddLine({left + top.x, top.y}, {left + top.x, top.y + line}, kInk);
  draw.AddLine({left + bottom.x, bottom.y}, {left + bottom.x, bottom.y - line}, kInk);
}

/// The vessels' outline over the picture, one rectangle for every run of pixels.
void draw_road_map(Viewer& viewer, const ImVec2& size) {
  if (!viewer.map()) return;
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  for (const Viewer::Pane& pane : viewer.panes(static_cast<int>(size.x), static_cast<int>(size.y))) {
    const auto outline = viewer.road_map(viewer.view_in(pane.width, pane.height));
    for (std::size_t i = 0; i < outline.size();) {
      std::size_t last = i + 1;
      while (last < outline.size() && outline[last] == outline[i] + glm::ivec2(static_cast<int>(last - i), 0))
        ++last;
      const auto x = static_cast<float>(pane.x + outline[i].x), y = static_cast<float>(outline[i].y);
      draw.AddRectFilled({x, y}, {x + static_cast<float>(last - i), y + 1},
                         IM_COL32(kRoadMapColour.x, kRoadMapColour.y, kRoadMapColour.z, 255));
      i = last;
    }
  }
}

/// Marks the picked vessel in every pane.
void draw_picked(const Viewer& viewer, const ImVec2& size) {
  const auto& picked = viewer.picked();
  if (!viewer.map() || !viewer.tree() || !picked) return;
  for (const Viewer::Pane& pane : viewer.panes(static_cast<int>(size.x), static_cast<int>(size.y))) {
    const glm::vec2 at(pixel_of(viewer.shown_in(pane), picked->centre_mm));
    const float x = static_cast<float>(pane.x) + at.x, reach = 0.4f * ImGui::GetFontSize();
    ImGui::GetBackgroundDrawList()->AddCircle({x, at.y}, reach, kInk, 0, 2);
    write(x + 2 * reach, at.y - reach, describe(*viewer.tree(), *picked));
  }
}

std::string status_line(const Viewer& viewer, const ImVec2& size) {
  if (!viewer.shows_panels) return viewer.caption();
  const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
  return fmt::format("{}   {:.0f} ms   {:.0f} x {:.0f}   {}   {:.1f} MB", viewer.caption(), viewer.frame_ms(),
                     size.x * scale.x, size.y * scale.y, gl_device_name(),
                     static_cast<double>(viewer.texture_B()) / 1e6);
}

void overlays(Viewer& viewer) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float line = ImGui::GetFontSize();
  const auto panes = viewer.panes(static_cast<int>(size.x), static_cast<int>(size.y));
  const auto bottom = static_cast<float>(panes.front().height);
  if (viewer.map()) {
    for (const Viewer::Pane& pane : panes) {
      const auto left = static_cast<float>(pane.x), width = static_cast<float>(pane.width);
      annotate(viewer, pane);
      if (panes.size() < 2) continue;
      std::string title = "body map";
      if (pane.is_drr) title = "true projection";
      if (pane.is_drr && viewer.psnr_db()) title += fmt::format(", PSNR {:.1f} dB", *viewer.psnr_db());
      write(left + width - line - width_of(title), line / 2, title);
    }
  } else {
    const auto status = viewer.status();
    const std::string words =
        status ? fmt::format("{}: {} ({:.0f} %)", status->name, status->stage, 100 * status->fraction)
               : "Drop a body map, a scan, vessels or a session here, or press Ctrl+O";
    write((size.x - width_of(words)) / 2, size.y / 2, words);
  }
  write(static_cast<float>(panes.front().x) + line, bottom - 1.4f * line, status_line(viewer, size));
  draw_road_map(viewer, size);
  draw_picked(viewer, size);
  if (!viewer.shows_help) return;
  ImGui::SetNextWindowPos({size.x / 2, size.y / 2}, ImGuiCond_Appearing, {0.5f, 0.5f});
  ImGui::Begin("Help", &viewer.shows_help, ImGuiWindowFlags_AlwaysAutoResize);
  std::vector<KeyHint> keys = usable_keys(operator_state(viewer));
  std::ranges::copy(general_keys(viewer), std::back_inserter(keys));
  list_keys(keys);
  ImGui::End();
}

/// Of the panel: above the exposure panel where that is at the lower left.
float highest(const Viewer& viewer) {
  return viewer.intervention() && viewer.console() ? exposure_panel_top(viewer) - 16 : FLT_MAX;
}

/// What follows the hashes identifies the header for all maps.
std::string layers_title(const MapGeometry& geometry) {
  if (geometry.ray_layout == RayLayout::rectangle) return "Pictures###layers";
  return fmt::format("Layers that follow {}###layers", geometry.has_outline() ? "the body" : "circles");
}

}  // namespace

void ViewerPanel::draw(Viewer& viewer) {
  overlays(viewer);
  open_dialogue(viewer);
  if (!viewer.shows_panels) return;
  ImGui::SetNextWindowPos({8, 8}, ImGuiCond_FirstUseEver);
  const float panel_width = 27 * ImGui::GetFontSize();
  ImGui::SetNextWindowSizeConstraints({panel_width, 0}, {panel_width, highest(viewer)});
  ImGui::Begin("xraycast", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  style_controls(viewer);
  if (viewer.map() && ImGui::CollapsingHeader(layers_title(viewer.map()->geometry).c_str()))
    layer_controls(viewer);
  // Its room is that of the exposure panel where there are all panels.
  const bool has_room = !viewer.intervention() || !viewer.console();
  if (viewer.map() && ImGui::CollapsingHeader("Opacity", has_room ? ImGuiTreeNodeFlags_DefaultOpen : 0))
    opacity_controls(viewer);
  file_controls(viewer);
  ImGui::End();
}

void ViewerPanel::style_controls(Viewer& viewer) {
  Style& style = viewer.style();
  for (const CArmPreset& preset : kCArmPresets) {
    if (ImGui::Button(preset.name)) viewer.pose().lao_rad = preset.angle_deg * std::numbers::pi / 180;
    ImGui::SameLine();
  }
  if (ImGui::Button("Reset")) viewer.reset_view();
  int look = style.look == Look::fluoro ? 0 : 1;
  if (ImGui::Combo("look", &look, "fluoro\0surface\0"))
    viewer.set_look(look == 0 ? Look::fluoro : Look::surface);
  int source = static_cast<int>(viewer.source());
  if (ImGui::Combo("compositing", &source,
                   viewer.has_scan() ? "path\0wall\0true projection\0" : "path\0wall\0"))
    viewer.set_source(static_cast<BodySource>(source));
  bool is_continuous = style.sampling.reconstruction == Reconstruction::linear;
  if (ImGui::Checkbox("linear between layers", &is_continuous))
    style.sampling.reconstruction = is_continuous ? Reconstruction::linear : Reconstruction::constant;
  ImGui::Checkbox("inverted", &style.window.inverted);
  ImGui::SameLine();
  bool is_automatic = !viewer.session().has_window;
  if (ImGui::Checkbox("automatic brightness", &is_automatic)) viewer.session().has_window = !is_automatic;
  if (style.look == Look::fluoro)
    ImGui::Checkbox("vessels and catheter at full contrast", &style.full_contrast);
  if (viewer.has_scan())
    ImGui::Checkbox("split view with the true projection", &viewer.is_split);
  else
    ImGui::TextDisabled("(open a scan for true projections)");
  auto gamma = static_cast<float>(style.window.gamma);
  if (ImGui::SliderFloat("gamma", &gamma, 0.4f, 2.5f)) style.window.gamma = gamma;
}

void ViewerPanel::layer_controls(Viewer& viewer) {
  auto& weights = viewer.style().layer_weights;
  const auto& radii_mm = viewer.map()->geometry.radii_mm;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    ImGui::PushID(static_cast<int>(k));
    float weight = weights[k];
    const std::string format =
        fmt::format("layer {}: {:.0f}-{:.0f} mm  %.2f", k + 1, radii_mm[k], radii_mm[k + 1]);
    const bool changed = ImGui::SliderFloat("##weight", &weight, 0, 2, format.c_str());
    if (ImGui::IsItemActivated()) viewer.opacity().begin_edit();
    if (changed) weights[k] = weight;
    ImGui::PopID();
  }
}

void ViewerPanel::opacity_controls(Viewer& viewer) {
  OpacityEditor& opacity = viewer.opacity();
  const std::string why_not =
      opacity.can_recast() ? "" : "no basis: open a basis\nor a scan to edit the opacity";
  const auto edit = curve_.draw(opacity.knots_hu(), opacity.mu_per_mm(), opacity.hu_histogram(),
                                Basis::kHistogramBin_hu, why_not);
  if (edit.knot >= 0) {
    if (edit.began) opacity.begin_edit();
    viewer.attempt([&] { opacity.set_knot(static_cast<std::size_t>(edit.knot), edit.mu_per_mm); });
  }
  if (!opacity.can_recast()) return;
  for (const char* preset : kOpacityPresets) {
    if (preset != kOpacityPresets[0]) continue_row_if_fits(preset);
    if (ImGui::Button(preset)) {
      opacity.begin_edit();
      viewer.attempt([&] { opacity.set_opacity(preset_mu_per_mm(preset, opacity.knots_hu())); });
    }
  }
}

void ViewerPanel::file_controls(Viewer& viewer) {
  if (ImGui::Button("Open")) ask_for_file();
  ImGui::SameLine();
  if (ImGui::Button("Picture")) viewer.save_picture();
  ImGui::SameLine();
  if (ImGui::Button("Cine")) viewer.save_cine();
  ImGui::SameLine();
  if (ImGui::Button("Undo")) viewer.attempt([&] { viewer.opacity().undo(); });
  ImGui::SameLine();
  if (ImGui::Button("Redo")) viewer.attempt([&] { viewer.opacity().redo(); });
  if (const auto status = viewer.status()) {
    ImGui::ProgressBar(static_cast<float>(status->fraction), {-1, 0},
                       fmt::format("{}: {}", status->name, status->stage).c_str());
    if (ImGui::Button("Cancel")) viewer.cancel();
  }
  if (!viewer.message().empty()) ImGui::TextWrapped("%s", viewer.message().c_str());
}

bool ViewerPanel::takes_key(int key) {
  if (!is_asking_) return ImGui::GetIO().WantTextInput && !has_asked_;
  accepts_ = key == GLFW_KEY_ENTER || key == GLFW_KEY_KP_ENTER;
  declines_ = key == GLFW_KEY_ESCAPE;
  has_asked_ = accepts_ || declines_;  // the next key no longer belongs to the dialogue
  is_asking_ = !has_asked_;
  return true;
}

void ViewerPanel::open_dialogue(Viewer& viewer) {
  has_asked_ = has_asked_ && ImGui::GetIO().WantTextInput;
  if (std::exchange(asks_, false)) {
    file_ = fs::current_path().string() + "/";
    accepts_ = declines_ = false;
    ImGui::OpenPopup("Open a file");
  }
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2, size.y / 2}, ImGuiCond_Appearing, {0.5f, 0.5f});
  is_asking_ = ImGui::BeginPopupModal("Open a file", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  if (!is_asking_) return;
  if (ImGui::IsWindowAppearing()) ImGui::SetKeyboardFocusHere();
  ImGui::SetNextItemWidth(40 * ImGui::GetFontSize());
  ImGui::InputText("##path", &file_);
  ImGui::TextUnformatted(
      "A body map, a basis, a scan, vessels, a catheter or a session; a DICOM scan is a folder.");
  const bool opens = ImGui::Button("Open") || accepts_;
  ImGui::SameLine();
  const bool closes = ImGui::Button("Cancel") || declines_;
  if (opens) viewer.open(file_);
  if (opens || closes) {
    ImGui::CloseCurrentPopup();
    is_asking_ = false;
    has_asked_ = true;
  }
  ImGui::EndPopup();
}

}  // namespace xraycast
