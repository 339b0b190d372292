#pragma once

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/simulation/run_report.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// A fluoroscope as its operator uses it: live pictures while the pedal is down and the last image after,
/// subtraction, a road map, and counters of dose over all changes of the settings.
class FluoroscopyConsole {
 public:
  /// Throws as `check` does for options.
  explicit FluoroscopyConsole(FluoroscopyOptions options);

  const FluoroscopyOptions& options() const { return options_; }

  /// Changes the settings; counters go on. Throws as `check`, and then changes nothing.
  void set(FluoroscopyOptions options);

  /// Other blades; none: they are open. Mask, angiogram and road map stay, but a mask that was taken behind
  /// blades which these do not lie within. Throws as `check`, and for blades that leave no pixel open, and
  /// then changes nothing.
  void collimate(const std::optional<Collimation>& blades);

  /// Compression of the display's range, 0 to 1. What was taken stays. Throws as `check`.
  void compress(double share);

  /// Low, normal, cine, and again.
  void next_dose();

  /// Whether the next pulse is due; call once a frame with the time since the last call. The first one is due
  /// at once when the pedal goes down. While a gate is closed it is not, and then as soon as that opens.
  bool is_due(bool pedal, double passed_s, bool is_gate_open = true);

  /// A pulse through optical depths of a view. In a view of another geometry, or of a map with another path,
  /// mask, angiogram and road map are lost. `phases` of a body in motion, in order, for masks that are
  /// matched.
  void expose(std::span<const float> tau, const View& view, const WaterPath& path,
              std::span<const double> phases = {});

  /// The held image: 8-bit greys, row 0 on top; empty before the first exposure.
  std::span<const std::uint8_t> image() const { return image_; }
  const View& view() const { return view_; }

  /// What the detector sent of that image, in its bits.
  std::span<const std::uint16_t> codes() const { return codes_; }

  /// Subtraction: the first pulses are averaged as the mask, with the exposure control locked.
  void subtract(bool subtracts);
  bool subtracts() const { return subtracts_; }
  void take_new_mask();

  /// Masks of phases of the body, for which pulses of a whole cycle are taken; none: the mean of a few.
  void match_masks(const std::optional<MaskMatching>& matching);

  /// How fast the body moves, by which a cycle takes its time; 0: it stands still.
  void set_motion_speed(double speed) { motion_speed_ = speed; }
  const std::optional<MaskMatching>& mask_matching() const { return matching_; }
  bool is_masking() const {
    return subtracts_ && (!acquisition_ || acquisition_->mask_frames() < mask_pulses());
  }
  void shift_mask(PixelShift shift);
  PixelShift mask_shift() const { return shift_; }
  bool shows_maximum_opacification = false;
  SubtractionWindow window;

  /// A road map of the vessels that were opacified since the last mask: they appear bright behind the live
  /// picture.
  bool has_angiogram() const { return acquisition_ && !acquisition_->opacified().empty(); }
  void show_road_map(bool shows);
  bool shows_road_map() const { return !road_map_.empty(); }

  DoseRecord dose() const;
  /// The same as a run's report has it.
  RunUse use() const;
  Technique technique() const;
  double kerma_rate() const;  ///< mGy/min, at the reference point
  bool is_locked() const { return acquisition_ && acquisition_->is_held(); }  ///< the exposure control
  bool is_saturated() const { return is_saturated_; }  ///< the detector, in the last pulse

  /// Mask, angiogram and road map, as with another map.
  void forget_pictures();

 private:
  int mask_pulses() const;
  void set_picture(FluoroscopyOptions options);
  void use_path(const WaterPath& path);
  void restart(const FluoroscopyOptions& options, const View& view);
  void turn_to(const View& view);

  FluoroscopyOptions options_;
  std::optional<Acquisition> acquisition_;  ///< made by the first exposure
  DoseRecord before_;                       ///< of earlier settings
  View view_;
  std::optional<WaterPath> path_;
  std::vector<std::uint8_t> image_;
  std::vector<std::uint16_t> codes_;
  bool pedal_ = false;
  double since_pulse_s_ = 0, paused_s_ = 0;
  bool begins_run_ = false, is_saturated_ = false, subtracts_ = false;
  PixelShift shift_;
  std::optional<MaskMatching> matching_;
  double motion_speed_ = 1;
  std::optional<Collimation> mask_blades_;  ///< as they were when the mask was taken
  std::vector<float> road_map_;
};

}  // namespace xraycast
