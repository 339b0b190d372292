#pragma once

#include "xraycast/fluoroscope/absorption_stage.hpp"
#include "xraycast/fluoroscope/exposure_control.hpp"
#include "xraycast/fluoroscope/fluoroscopy_options.hpp"

#include <map>

namespace xraycast {

/// What depends on the exposure: the beams of the tube's voltages, the technique of the next pulse, the
/// control that chooses it, and the dose that was given.
class XrayGenerator {
 public:
  /// Throws as `check`.
  XrayGenerator(FluoroscopyOptions options, WaterPath path);

  const FluoroscopyOptions& options() const { return options_; }
  const WaterPath& path() const { return path_; }

  /// Before the first pulse, and when the detector has moved or the picture has other pixels.
  void set_detector(const Cone& distances, double pixel_mm);

  /// The next pulse has the technique that goes with the new level.
  void set_dose(DoseLevel level);

  /// What the options say of the picture; it changes no exposure by itself.
  void set_picture(const std::optional<Collimation>& collimation, std::optional<double> compression) {
    options_.collimation = collimation;
    options_.compression = compression;
  }

  /// For the optical depths of another map.
  void set_path(WaterPath path);

  /// No mAs where no tube gives the photons.
  const Technique& technique() const { return technique_; }
  BeamAndTable beam_and_table();
  double open_quanta();       ///< that a pixel of the open field detects in the next pulse
  double target_kev() const;  ///< the exposure control's, as mean signal of a pixel
  double kerma_rate_mGy_min();

  /// The signal of the largest code. Gain follows the dose level, so that the control's target has a tenth of
  /// all codes; with an exposure by hand the open field just fits, and where a part is by hand twice what 10
  /// cm of water leaves.
  double full_scale_kev();

  /// After a pulse that gave this mean signal in the measuring field: whether the technique changed, which it
  /// does not while it is held.
  bool follow(double mean_kev, bool is_held);

  void count_pulse(double open_area_cm2);
  const DoseRecord& dose() const { return dose_; }

 private:
  const FluoroscopyBeam& beam(int kvp);
  ExposureControl control();
  Technique first_technique();
  double quanta_per_mas(int kvp);
  double full_scale_for_options();

  FluoroscopyOptions options_;
  WaterPath path_;
  double absorbed_kev_;  ///< a cm2 and uGy
  double pixel_cm2_ = 0;
  double full_scale_kev_ = 0;  ///< 0: not computed yet
  std::map<int, FluoroscopyBeam> beams_;
  std::map<int, QuantaTable> tables_;  ///< of voltages that were used: the exposure control compares many
  Technique technique_, last_;
  double last_mean_kev_ = 0;  ///< of the last pulse, with `last_`; 0: there was none in this geometry
  DoseRecord dose_;
};

}  // namespace xraycast
