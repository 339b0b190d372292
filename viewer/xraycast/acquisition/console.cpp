#include "xraycast/acquisition/console.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// Live greys with the vessels brighter, by no more than leaves a catheter in them visible.
void blend_greys(std::span<const float> vessels, double black, std::span<std::uint8_t> greys) {
  constexpr float kBrightest = 90, kWhite = 255;
  const float per_tau = kBrightest / static_cast<float>(black);
  for (std::size_t i = 0; i < greys.size(); ++i)
    greys[i] = static_cast<std::uint8_t>(
        std::min(kWhite, static_cast<float>(greys[i]) + std::min(kBrightest, per_tau * vessels[i])));
}

/// What rises above the picture's median: most of a picture is no vessel, but the largest of many noisy
/// values.
std::vector<float> above_median(std::span<const float> picture) {
  std::vector<float> sorted(picture.begin(), picture.end());
  const auto middle = sorted.begin() + std::ssize(sorted) / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  std::vector<float> above(picture.begin(), picture.end());
  for (float& value : above) value = std::max(0.0f, value - *middle);
  return above;
}

}  // namespace

FluoroscopyConsole::FluoroscopyConsole(FluoroscopyOptions options) : options_(std::move(options)) {
  check(options_);
  window.black = 0.5;
}

void FluoroscopyConsole::set(FluoroscopyOptions options) {
  check(options);
  if (acquisition_) restart(options, view_);
  options_ = std::move(options);
  forget_pictures();
}

void FluoroscopyConsole::set_picture(FluoroscopyOptions options) {
  check(options);
  if (acquisition_) acquisition_->fluoroscope()->set_picture(options.collimation, options.compression);
  options_ = std::move(options);
}

void FluoroscopyConsole::collimate(const std::optional<Collimation>& blades) {
  FluoroscopyOptions options = options_;
  options.collimation = blades;
  set_picture(std::move(options));
  const bool is_within_mask = !mask_blades_ || (blades && blades->turn_rad == mask_blades_->turn_rad &&
                                                blades->width_mm <= mask_blades_->width_mm &&
                                                blades->height_mm <= mask_blades_->height_mm);
  if (subtracts_ && !is_within_mask) take_new_mask();
}

void FluoroscopyConsole::compress(double share) {
  FluoroscopyOptions options = options_;
  options.compression = share;
  set_picture(std::move(options));
}

void FluoroscopyConsole::next_dose() {
  options_.dose = options_.dose == DoseLevel::low      ? DoseLevel::normal
                  : options_.dose == DoseLevel::normal ? DoseLevel::cine
                                                       : DoseLevel::low;
  if (acquisition_) acquisition_->set_dose(options_.dose);
}

bool FluoroscopyConsole::is_due(bool pedal, double passed_s, bool is_gate_open) {
  const bool was_down = pedal_;
  pedal_ = pedal;
  if (!was_down || !pedal) paused_s_ += passed_s;
  if (!pedal) return false;
  begins_run_ = begins_run_ || !was_down;
  since_pulse_s_ = was_down ? since_pulse_s_ + passed_s : 1 / options_.pulses_per_s;
  if (!is_gate_open) since_pulse_s_ = std::min(since_pulse_s_, 1 / options_.pulses_per_s);
  if (since_pulse_s_ * options_.pulses_per_s < 1 || !is_gate_open) return false;
  // A display that is late skips pulses; it does not make up for them.
  since_pulse_s_ = std::min(since_pulse_s_ - 1 / options_.pulses_per_s, 1 / options_.pulses_per_s);
  return true;
}

/// Throws as the fluoroscope does, and then keeps the one that was there.
void FluoroscopyConsole::restart(const FluoroscopyOptions& options, const View& view) {
  const DoseRecord before = dose();
  FluoroscopyOptions continued = options;
  continued.seed += static_cast<std::uint32_t>(before.pulses);  // or the noise of earlier pulses comes again
  Acquisition other(
      {.fluoroscope = continued, .subtracts = subtracts_, .mask_shift = shift_, .mask_matching = matching_},
      view, *path_);
  acquisition_.emplace(std::move(other));
  before_ = before;
}

void FluoroscopyConsole::forget_pictures() {
  take_new_mask();
  road_map_.clear();
}

/// What another map leaves of the last one is nothing.
void FluoroscopyConsole::use_path(const WaterPath& path) {
  if (path_ == path) return;
  path_ = path;
  if (acquisition_) acquisition_->fluoroscope()->set_path(path);
  forget_pictures();
}

/// Throws as the fluoroscope does, and then stays where it was.
void FluoroscopyConsole::turn_to(const View& view) {
  acquisition_->fluoroscope()->set_view(view);
  if (view_ != view) forget_pictures();
  view_ = view;
}

int FluoroscopyConsole::mask_pulses() const {
  constexpr int kUsual = 4;
  if (!matching_ || motion_speed_ <= 0) return kUsual;
  return 1 + static_cast<int>(std::ceil(matching_->cycle_s / motion_speed_ * options_.pulses_per_s));
}

void FluoroscopyConsole::match_masks(const std::optional<MaskMatching>& matching) {
  matching_ = matching;
  if (acquisition_) acquisition_->match_masks(matching);
}

void FluoroscopyConsole::expose(std::span<const float> tau, const View& view, const WaterPath& path,
                                std::span<const double> phases) {
  use_path(path);
  if (!acquisition_) {
    restart(options_, view);
    if (!subtracts_) acquisition_->settle(tau);  // subtraction settles after a pause
    view_ = view;
  }
  turn_to(view);
  if (begins_run_) acquisition_->fluoroscope()->begin_run(paused_s_);
  begins_run_ = false;
  paused_s_ = 0;
  acquisition_->set_phases(phases);
  const bool is_mask = is_masking();
  if (is_mask) mask_blades_ = options_.collimation;
  const AcquiredFrame& frame =
      acquisition_->expose(tau, view, is_mask ? Acquisition::Use::mask : Acquisition::Use::filled);
  is_saturated_ = frame.pulse->is_saturated;
  codes_ = frame.pulse->codes;
  if (subtracts_) {
    const bool is_whole = shows_maximum_opacification && has_angiogram();
    image_ = subtraction_greys(is_whole ? acquisition_->opacified() : frame.difference, window);
  } else {
    image_ = frame.pulse->shown;
    if (shows_road_map()) blend_greys(road_map_, window.black, image_);
  }
}

void FluoroscopyConsole::subtract(bool subtracts) {
  if (subtracts == subtracts_) return;
  subtracts_ = subtracts;
  if (subtracts) forget_pictures();
  if (acquisition_) acquisition_->subtract(subtracts);
}

void FluoroscopyConsole::take_new_mask() {
  if (acquisition_) acquisition_->forget_mask();
}

void FluoroscopyConsole::shift_mask(PixelShift shift) {
  shift_ = shift;
  if (acquisition_) acquisition_->shift_mask(shift);
}

void FluoroscopyConsole::show_road_map(bool shows) {
  road_map_.clear();
  if (shows && has_angiogram()) road_map_ = above_median(acquisition_->opacified());
}

DoseRecord FluoroscopyConsole::dose() const {
  if (!acquisition_) return before_;
  const DoseRecord& now = acquisition_->fluoroscope()->dose();
  return {before_.air_kerma_mGy + now.air_kerma_mGy, before_.dap_Gycm2 + now.dap_Gycm2,
          before_.fluoroscopy_s + now.fluoroscopy_s, before_.images + now.images,
          before_.pulses + now.pulses};
}

RunUse FluoroscopyConsole::use() const {
  const DoseRecord now = dose();
  return {.fluoroscopy_s = now.fluoroscopy_s,
          .exposures = now.pulses,
          .air_kerma_mGy = now.air_kerma_mGy,
          .dap_Gycm2 = now.dap_Gycm2};
}

Technique FluoroscopyConsole::technique() const {
  return acquisition_ ? acquisition_->fluoroscope()->technique() : Technique{};
}

double FluoroscopyConsole::kerma_rate() const {
  return acquisition_ ? acquisition_->fluoroscope()->kerma_rate_mGy_min() : 0;
}

}  // namespace xraycast
