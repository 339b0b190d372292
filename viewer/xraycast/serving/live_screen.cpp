#include "xraycast/serving/live_screen.hpp"

#include "xraycast/drawing/brightness.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// In 16 bits what a display shows in 8, with the full contrast of what is inside the body where that is
/// asked for.
std::vector<std::uint16_t> fine_greys(const std::vector<float>& tau, const std::vector<float>& body_tau,
                                      const Style& style) {
  constexpr float kWhite = 65535;
  const GreyWindow& window = style.window;
  const auto scale = static_cast<float>(window.scale), dark = static_cast<float>(window.dark),
             contrast = static_cast<float>(1 / (window.light - window.dark)),
             bend = static_cast<float>(1 / window.gamma),
             weight = style.full_contrast ? std::max(1.0f, scale) : 1.0f;
  std::vector<std::uint16_t> greys(tau.size());
  for (std::size_t i = 0; i < tau.size(); ++i) {
    const float shown_tau = body_tau[i] + weight * (tau[i] - body_tau[i]);
    float grey = std::clamp((std::exp(-shown_tau / scale) - dark) * contrast, 0.0f, 1.0f);
    if (bend != 1) grey = std::pow(grey, bend);
    greys[i] = static_cast<std::uint16_t>(std::lround(kWhite * (window.inverted ? 1 - grey : grey)));
  }
  return greys;
}

}  // namespace

LiveScreen::LiveScreen(std::shared_ptr<const BodyMap> map, const Options& options)
    : map_(std::move(map)), options_(options) {
  renderer_.set_map(map_);
  renderer_.set_implants(options_.implants);
  if (!options_.fluoroscopy) return;
  options_.style.pixels_per_column = kLivePixelsPerColumn;
  console_.emplace(*options_.fluoroscopy);
  water_path_.emplace(map_->attenuation);
}

View LiveScreen::view_from(const CArmPose& pose) const {
  View view = options_.view;
  view.lao_rad = pose.lao_rad;
  view.cranial_rad = pose.cranial_rad;
  view.centre_mm.z += pose.table_mm;
  view.pixel_mm /= pose.zoom;
  return view;
}

bool LiveScreen::is_due(bool is_live, bool is_gate_open, double passed_s) {
  return console_ ? console_->is_due(is_live, passed_s, is_gate_open) : is_live && is_gate_open;
}

PulseBlur LiveScreen::blur(const CArmPose& pose) const {
  if (!console_) return {};
  return {.pulse_s = 1e-3 * console_->options().c_arm.tube.pulse_ms,
          .pixel_mm = pixel_at_axis_mm(view_from(pose))};
}

const LivePicture& LiveScreen::draw(const Intervention& intervention) {
  if (std::exchange(surfaces_, intervention.surfaces().size()) != intervention.surfaces().size())
    renderer_.set_surfaces(intervention.surfaces());
  for (std::size_t i = 0; i < intervention.surfaces().size(); ++i)
    renderer_.replace_surface(i, intervention.surfaces()[i]);
  if (map_->keys && !intervention.phases().empty()) renderer_.set_phases(intervention.phases());
  picture_.view = view_from(intervention.pose());
  console_ ? draw_pulse() : draw_greys();
  return picture_;
}

void LiveScreen::draw_pulse() {
  console_->expose(renderer_.tau(picture_.view, options_.style), picture_.view, *water_path_);
  if (options_.is_fine)
    picture_.codes.assign(console_->codes().begin(), console_->codes().end());
  else
    picture_.greys.assign(console_->image().begin(), console_->image().end());
}

void LiveScreen::draw_greys() {
  const View& view = picture_.view;
  if (!options_.has_window && adapted_to_ != view)
    options_.style.window = automatic_window(renderer_, view, options_.style);
  if (options_.is_fine) {
    if (adapted_to_ != view || map_->keys) body_tau_ = renderer_.body_tau(view, options_.style);
    picture_.codes = fine_greys(renderer_.tau(view, options_.style), body_tau_, options_.style);
  } else {
    const std::vector<std::uint8_t> rgb = renderer_.picture(view, options_.style);
    picture_.greys.resize(rgb.size() / 3);
    for (std::size_t i = 0; i < picture_.greys.size(); ++i) picture_.greys[i] = rgb[3 * i];
  }
  adapted_to_ = view;
}

}  // namespace xraycast
