#include "xraycast/fluoroscope/console.hpp"

#include <algorithm>
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
  std::ranges::nth_element(sorted, middle);
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
  if (fluoroscope_) restart(options, view_);
  options_ = std::move(options);
  is_locked_ = false;
  forget_pictures();
}

void FluoroscopyConsole::next_dose() {
  options_.dose = options_.dose == DoseLevel::low      ? DoseLevel::normal
                  : options_.dose == DoseLevel::normal ? DoseLevel::cine
                                                       : DoseLevel::low;
  if (fluoroscope_) fluoroscope_->set_dose(options_.dose);
  unlock();
}

/// The exposure control works again, and a mask of the locked exposure no longer fits.
void FluoroscopyConsole::unlock() {
  if (!is_locked_) return;
  is_locked_ = false;
  fluoroscope_->hold_technique(false);
  subtraction_.reset();
}

bool FluoroscopyConsole::is_due(bool pedal, double passed_s) {
  const bool was_down = pedal_;
  pedal_ = pedal;
  if (!was_down || !pedal) paused_s_ += passed_s;
  if (!pedal) return false;
  begins_run_ = begins_run_ || !was_down;
  since_pulse_s_ = was_down ? since_pulse_s_ + passed_s : 1 / options_.pulses_per_s;
  if (since_pulse_s_ * options_.pulses_per_s < 1) return false;
  // A display that is late skips pulses; it does not make up for them.
  since_pulse_s_ = std::min(since_pulse_s_ - 1 / options_.pulses_per_s, 1 / options_.pulses_per_s);
  return true;
}

/// Throws as the fluoroscope does, and then keeps the one that was there.
void FluoroscopyConsole::restart(const FluoroscopyOptions& options, const View& view) {
  const DoseRecord before = dose();
  FluoroscopyOptions continued = options;
  continued.seed += static_cast<std::uint32_t>(before.pulses);  // or the noise of earlier pulses comes again
  Fluoroscope other(std::move(continued), view, *path_);
  fluoroscope_.emplace(std::move(other));
  before_ = before;
}

void FluoroscopyConsole::forget_pictures() {
  subtraction_.reset();
  opacified_.clear();
  road_map_.clear();
}

/// What another map leaves of the last one is nothing.
void FluoroscopyConsole::use_path(const WaterPath& path) {
  if (path_ == path) return;
  path_ = path;
  if (fluoroscope_) fluoroscope_->set_path(path);
  forget_pictures();
}

void FluoroscopyConsole::expose(std::span<const float> tau, const View& view, const WaterPath& path) {
  use_path(path);
  if (!fluoroscope_) {
    restart(options_, view);
    fluoroscope_->settle(tau);
    view_ = view;
  }
  fluoroscope_->set_view(view);
  if (view_ != view) forget_pictures();
  view_ = view;
  if (begins_run_) fluoroscope_->begin_run(paused_s_);
  begins_run_ = false;
  paused_s_ = 0;
  if (subtracts_ && !is_locked_) {
    // As a unit does, after the exposure control has settled.
    fluoroscope_->settle(tau);
    fluoroscope_->hold_technique(true);
    is_locked_ = true;
  }
  const FluoroscopyFrame& frame = fluoroscope_->expose(tau);
  is_saturated_ = frame.is_saturated;
  codes_ = frame.codes;
  if (subtracts_)
    show_subtracted(frame);
  else
    show_live(frame);
}

void FluoroscopyConsole::show_live(const FluoroscopyFrame& frame) {
  image_ = frame.shown;
  if (shows_road_map()) blend_greys(road_map_, window.black, image_);
}

void FluoroscopyConsole::show_subtracted(const FluoroscopyFrame& frame) {
  difference_.resize(frame.logarithm.size());
  frame_ = measured_depths(frame);
  if (!subtraction_) {
    subtraction_.emplace(view_.width, view_.height);
    subtraction_->shift_mask(shift_);
  }
  const bool masks = is_masking();
  if (masks) subtraction_->add_to_mask(frame_);
  subtraction_->subtract(frame_, difference_);
  fluoroscope_->clear_behind_blades(difference_);
  if (!masks) opacified_.add(difference_);
  const bool is_whole = shows_maximum_opacification && has_angiogram();
  image_ = subtraction_greys(is_whole ? opacified_.picture() : difference_, window);
}

void FluoroscopyConsole::subtract(bool subtracts) {
  if (subtracts == subtracts_) return;
  subtracts_ = subtracts;
  if (subtracts) return forget_pictures();
  unlock();
}

void FluoroscopyConsole::take_new_mask() {
  subtraction_.reset();
  opacified_.clear();
}

void FluoroscopyConsole::shift_mask(PixelShift shift) {
  shift_ = shift;
  if (subtraction_) subtraction_->shift_mask(shift);
}

void FluoroscopyConsole::show_road_map(bool shows) {
  road_map_.clear();
  if (shows && has_angiogram()) road_map_ = above_median(opacified_.picture());
}

DoseRecord FluoroscopyConsole::dose() const {
  if (!fluoroscope_) return before_;
  const DoseRecord& now = fluoroscope_->dose();
  return {before_.air_kerma_mGy + now.air_kerma_mGy, before_.dap_Gycm2 + now.dap_Gycm2,
          before_.fluoroscopy_s + now.fluoroscopy_s, before_.images + now.images,
          before_.pulses + now.pulses};
}

Technique FluoroscopyConsole::technique() const {
  return fluoroscope_ ? fluoroscope_->technique() : Technique{};
}

double FluoroscopyConsole::kerma_rate() const {
  return fluoroscope_ ? fluoroscope_->kerma_rate_mGy_min() : 0;
}

}  // namespace xraycast
