#pragma once

#include "xraycast/acquisition/mask_phase.hpp"
#include "xraycast/acquisition/phase_masks.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"
#include "xraycast/fluoroscope/subtraction.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// How pictures are acquired with a C-arm.
struct AcquisitionOptions {
  std::optional<FluoroscopyOptions> fluoroscope{};  ///< none: optical depths without noise
  bool subtracts = false;                           ///< digital subtraction angiography
  PixelShift mask_shift{};                          ///< subtraction: of the mask
  bool shows_maximum_opacification = false;  ///< subtraction: every frame has the vessels filled so far
  /// Subtraction: masks of phases of the body; none: their mean, whatever the phase.
  std::optional<MaskMatching> mask_matching{};
};

/// How the greys of a pulse or a difference are displayed.
struct GreyDisplay {
  double gamma = 1;
  bool inverted = false;  ///< bone is bright
};
std::vector<std::uint8_t> displayed(std::vector<std::uint8_t> greys, const GreyDisplay& display);

/// How a fluoroscope has exposed.
struct ExposureRecord {
  std::string c_arm;
  Technique technique;  ///< of the last pulse
  double pulse_ms = 0;
  bool is_fluoroscopy = true;  ///< false: a recorded run
  DoseRecord dose;             ///< of all pulses so far
  bool has_dose = false;       ///< false: the photons were given, and no tube's output is known
};

/// One picture, H x W, row 0 on top. Valid until the next is taken.
struct AcquiredFrame {
  View view;
  std::span<const float> tau{};             ///< the rays' optical depths, without noise; empty for masses
  std::span<const float> difference{};      ///< subtraction: what has come since the mask
  const FluoroscopyFrame* pulse = nullptr;  ///< null without a fluoroscope
};

/// Its 8-bit greys: of the difference, the pulse, or the depths in an automatic window.
std::vector<std::uint8_t> shown(const AcquiredFrame& frame, const GreyDisplay& display);

/// The water behind a map's or a scan's depths, where there is a fluoroscope: a spectrum may have none.
std::optional<WaterPath> path_of(const Attenuation& attenuation, const AcquisitionOptions& options);

/// Pictures of a C-arm, one after the other, from the rays of a map or a scan: with a fluoroscope its pulses,
/// and with subtraction the differences from a mask.
///
/// Before the first frame, and before each mask, the exposure control settles, or lag alone where subtraction
/// holds the technique: frames that are subtracted must be exposed as their mask is.
class Acquisition {
 public:
  /// `first` must be complete; the path matters to a fluoroscope only. Throws as Fluoroscope.
  Acquisition(const AcquisitionOptions& options, const View& first, const std::optional<WaterPath>& path);

  /// A frame; of a mask, it is also added to that, which is the mean of its frames.
  enum class Use { filled, mask };
  const AcquiredFrame& expose(const RayDepths& rays, const View& view, Use use = Use::filled);

  /// Of the next exposures, in the motion's order: masks are matched by them.
  void set_phases(std::span<const double> phases) { phases_.assign(phases.begin(), phases.end()); }

  /// Settles now, for the view of the last frame.
  void settle(const RayDepths& rays);

  /// Subtraction: the next frames are another mask's; before the first one it settles, or without that only
  /// forgets the last mask.
  void begin_mask();
  void forget_mask();

  // What an operator changes: subtraction begins another mask.
  void subtract(bool subtracts);
  void set_dose(DoseLevel dose);
  void shift_mask(PixelShift shift);
  void match_masks(const std::optional<MaskMatching>& matching);  ///< begins another mask

  /// Subtraction: the most that every pixel had in a frame since the mask; empty before.
  std::span<const float> opacified() const { return opacified_.picture(); }

  const AcquisitionOptions& options() const { return options_; }
  const Fluoroscope* fluoroscope() const { return fluoroscope_ ? &*fluoroscope_ : nullptr; }
  Fluoroscope* fluoroscope() { return fluoroscope_ ? &*fluoroscope_ : nullptr; }
  int mask_frames() const {
    return options_.mask_matching ? masks_.count() : subtraction_ ? subtraction_->mask_frames() : 0;
  }
  bool is_saturated() const { return is_saturated_; }                 ///< the detector, in any pulse
  bool is_held() const { return options_.subtracts && is_settled_; }  ///< the technique

  /// None without a fluoroscope.
  std::optional<ExposureRecord> record() const;

 private:
  void unlock();
  void subtract_mask(std::span<const float> depths, Use use);
  void take_mask(std::span<const float> depths, Use use);

  AcquisitionOptions options_;
  std::optional<Fluoroscope> fluoroscope_;
  std::optional<Subtraction> subtraction_;
  PhaseMasks masks_;
  std::vector<double> phases_;
  MaximumOpacification opacified_;
  AcquiredFrame frame_;
  std::vector<float> difference_;
  bool is_settled_ = false, is_saturated_ = false;
  Technique technique_;  ///< of the last pulse
};

}  // namespace xraycast
