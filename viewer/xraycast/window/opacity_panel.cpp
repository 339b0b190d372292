#include "xraycast/window/opacity_panel.hpp"

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <imgui.h>

namespace xraycast {
namespace {

constexpr double kMin_hu = -1024, kMax_hu = 2000, kMax_per_mm = 0.08;

Opacity preset(const std::string& name) {
  if (name == "paper") return Opacity::paper();
  if (name == "bone") return {name, {{150, 0}, {1000, 0.06}}};
  if (name == "soft tissue") return {name, {{-150, 0}, {0, 0.02}, {150, 0.025}, {300, 0}}};
  if (name == "vessels") return {name, {{120, 0}, {350, 0.05}}};
  if (name == "lung") return {name, {{-950, 0}, {-800, 0.01}, {-500, 0.004}, {-300, 0}}};
  if (name == "subtracted") return Opacity::subtracted();
  throw InputError("there is no opacity preset '{}'", name);
}

}  // namespace

std::vector<double> preset_mu_per_mm(const std::string& name, std::span<const double> knots_hu) {
  const Opacity opacity = preset(name);
  std::vector<double> mu;
  for (const double hu : knots_hu) mu.push_back(opacity.mu_per_mm(hu));
  return mu;
}

OpacityPanel::Edit OpacityPanel::draw(std::span<const double> knots_hu, std::span<const double> mu_per_mm,
                                      std::span<const std::int64_t> histogram, int bin_hu,
                                      const std::string& why_not) {
  const ImVec2 origin = ImGui::GetCursorScreenPos();
  const ImVec2 size(ImGui::GetContentRegionAvail().x, 10 * ImGui::GetFontSize());
  ImGui::InvisibleButton("curve", size);
  const bool is_held = ImGui::IsItemActive(), is_over = ImGui::IsItemHovered();
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const auto at = [&](double hu, double mu) {
    return ImVec2(origin.x + static_cast<float>((hu - kMin_hu) / (kMax_hu - kMin_hu)) * size.x,
                  origin.y + size.y * static_cast<float>(1 - std::min(1.0, mu / kMax_per_mm)));
  };
  draw.AddRectFilled(origin, {origin.x + size.x, origin.y + size.y}, IM_COL32(24, 26, 31, 255));
  // On a logarithmic scale, otherwise air and water would dwarf everything else.
  double highest = 1;
  for (const std::int64_t count : histogram)
    highest = std::max(highest, std::log1p(static_cast<double>(count)));
  for (std::size_t bin = 0; bin < histogram.size(); ++bin) {
    const double hu = kMin_hu + static_cast<double>(bin) * bin_hu;
    if (hu > kMax_hu) break;
    const double height = std::log1p(static_cast<double>(histogram[bin])) / highest;
    draw.AddRectFilled(at(hu, height * kMax_per_mm), {at(hu + bin_hu, 0).x, origin.y + size.y},
                       IM_COL32(70, 78, 95, 255));
  }
  if (!why_not.empty()) {
    draw.AddText({origin.x + 8, origin.y + 8}, IM_COL32(220, 220, 220, 255), why_not.c_str());
    dragged_ = -1;
    return {};
  }

  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const float reach = 0.6f * ImGui::GetFontSize();
  int nearest = -1;
  float distance = reach * reach;
  for (std::size_t i = 0; i < knots_hu.size(); ++i) {
    if (knots_hu[i] > kMax_hu) continue;
    const ImVec2 p = at(knots_hu[i], mu_per_mm[i]);
    const float d = (p.x - mouse.x) * (p.x - mouse.x) + (p.y - mouse.y) * (p.y - mouse.y);
    if (d < distance) {
      distance = d;
      nearest = static_cast<int>(i);
    }
  }
  const bool began = is_held && ImGui::IsMouseClicked(ImGuiMouseButton_Left) && nearest >= 0;
  if (began) dragged_ = nearest;
  for (std::size_t i = 0; i < knots_hu.size(); ++i) {
    const ImVec2 p = at(std::min(knots_hu[i], kMax_hu), mu_per_mm[i]);
    if (i > 0) draw.AddLine(at(knots_hu[i - 1], mu_per_mm[i - 1]), p, IM_COL32(255, 190, 90, 255), 1.5f);
    const bool is_marked = static_cast<int>(i) == dragged_ || (is_over && static_cast<int>(i) == nearest);
    draw.AddCircleFilled(p, is_marked ? 5.0f : 3.0f, IM_COL32(255, 220, 150, 255));
  }
  if (dragged_ < 0) return {};
  const int knot = dragged_;
  const double mu =
      std::clamp(kMax_per_mm * (1 - (mouse.y - origin.y) / static_cast<double>(size.y)), 0.0, kMax_per_mm);
  ImGui::SetTooltip("%.0f HU: %.4f /mm", knots_hu[knot], mu);
  if (is_held) return {knot, mu, began};
  dragged_ = -1;
  return {};
}

}  // namespace xraycast
