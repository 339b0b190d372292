#include "xraycast/acquisition/acquisition.hpp"

#include "xraycast/base/image.hpp"

#include <array>
#include <cmath>

namespace xraycast {

std::vector<std::uint8_t> displayed(std::vector<std::uint8_t> greys, const GreyDisplay& display) {
  constexpr int kWhite = 255;
  std::array<std::uint8_t, kWhite + 1> shown{};
  for (int value = 0; value <= kWhite; ++value) {
    const double bent = std::pow(1.0 * value / kWhite, 1 / display.gamma);
    shown[static_cast<std::size_t>(value)] =
        static_cast<std::uint8_t>(std::lround(kWhite * (display.inverted ? 1 - bent : bent)));
  }
  for (std::uint8_t& value : greys) value = shown[value];
  return greys;
}

std::vector<std::uint8_t> shown(const AcquiredFrame& frame, const GreyDisplay& display) {
  const std::span<const float> difference = frame.difference;
  if (!difference.empty())
    return displayed(subtraction_greys(difference, automatic_subtraction_window(difference)), display);
  if (frame.pulse) return displayed(frame.pulse->shown, display);
  return windowed(frame.tau, automatic_window(frame.tau, display.gamma, display.inverted));
}

std::optional<WaterPath> path_of(const Attenuation& attenuation, const AcquisitionOptions& options) {
  return options.fluoroscope ? std::optional<WaterPath>(attenuation) : std::nullopt;
}

Acquisition::Acquisition(const AcquisitionOptions& options, const View& first,
                         const std::optional<WaterPath>& path)
    : options_(options) {
  if (options_.fluoroscope) fluoroscope_.emplace(*options_.fluoroscope, first, path.value());
}

void Acquisition::subtract(bool subtracts) {
  options_.subtracts = subtracts;
  subtracts ? begin_mask() : unlock();
}

void Acquisition::set_dose(DoseLevel dose) {
  fluoroscope_->set_dose(dose);
  if (is_held()) unlock();
}

/// The exposure control works again, and a mask of the locked exposure no longer fits.
void Acquisition::unlock() {
  fluoroscope_->hold_technique(false);
  subtraction_.reset();
  masks_.clear();
  is_settled_ = !options_.subtracts;
}

void Acquisition::shift_mask(PixelShift shift) {
  options_.mask_shift = shift;
  if (subtraction_) subtraction_->shift_mask(shift);
}

void Acquisition::match_masks(const std::optional<MaskMatching>& matching) {
  options_.mask_matching = matching;
  begin_mask();
}

void Acquisition::begin_mask() {
  forget_mask();
  is_settled_ = false;
}

void Acquisition::forget_mask() {
  subtraction_.reset();
  masks_.clear();
  opacified_.clear();
}

void Acquisition::settle(const RayDepths& rays) {
  is_settled_ = true;
  fluoroscope_->settle(rays);
  fluoroscope_->hold_technique(options_.subtracts);
}

const AcquiredFrame& Acquisition::expose(const RayDepths& rays, const View& view, Use use) {
  const auto* tau = std::get_if<std::span<const float>>(&rays);
  frame_ = {.view = view, .tau = tau ? *tau : std::span<const float>()};
  if (fluoroscope_) {
    fluoroscope_->set_view(view);
    if (!is_settled_) settle(rays);
    frame_.pulse = &fluoroscope_->expose(rays);
    technique_ = frame_.pulse->technique;
    is_saturated_ = is_saturated_ || frame_.pulse->is_saturated;
  }
  if (options_.subtracts) subtract_mask(fluoroscope_ ? measured_depths(*frame_.pulse) : frame_.tau, use);
  return frame_;
}

void Acquisition::subtract_mask(std::span<const float> depths, Use use) {
  if (!subtraction_) {
    subtraction_.emplace(frame_.view.width, frame_.view.height);
    subtraction_->shift_mask(options_.mask_shift);
  }
  const bool is_mask = use == Use::mask;
  take_mask(depths, use);
  difference_.resize(depths.size());
  subtraction_->subtract(depths, difference_);
  if (fluoroscope_) fluoroscope_->clear_behind_blades(difference_);
  frame_.difference = difference_;
  if (!is_mask) opacified_.add(difference_);
  if (options_.shows_maximum_opacification && !is_mask) frame_.difference = opacified_.picture();
}

/// The mean of all masks, or the one whose phase is nearest.
void Acquisition::take_mask(std::span<const float> depths, Use use) {
  const auto& matching = options_.mask_matching;
  if (!matching) {
    if (use == Use::mask) subtraction_->add_to_mask(depths);
    return;
  }
  const double phase = matching->mode < phases_.size() ? phases_[matching->mode] : 0;
  if (use == Use::mask) masks_.add(phase, depths);
  if (masks_.count() > 0)
    subtraction_->set_mask(masks_.nearest(matching->phase.value_or(phase), matching->wraps));
}

std::optional<ExposureRecord> Acquisition::record() const {
  if (!fluoroscope_) return std::nullopt;
  const FluoroscopyOptions& options = fluoroscope_->options();
  return ExposureRecord{.c_arm = options.c_arm.name,
                        .technique = technique_,
                        .pulse_ms = options.c_arm.tube.pulse_ms,
                        .is_fluoroscopy = options.dose != DoseLevel::cine,
                        .dose = fluoroscope_->dose(),
                        .has_dose = technique_.mas > 0};
}

}  // namespace xraycast
