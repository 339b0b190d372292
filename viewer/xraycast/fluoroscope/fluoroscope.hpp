#pragma once

#include "xraycast/fluoroscope/fluoroscopy_options.hpp"
#include "xraycast/fluoroscope/water_path.hpp"
#include "xraycast/projection/view.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// One pulse's picture, H x W, row 0 on top.
struct FluoroscopyFrame {
  std::vector<float> signal_kev;     ///< raw: absorbed energy of every pixel
  std::vector<std::uint16_t> codes;  ///< what the detector sends, in its bits
  std::vector<float> logarithm;      ///< natural, of the codes above the dark level
  std::vector<std::uint8_t> shown;   ///< behind the display chain; the body is dark, as on a fluoroscope
  Technique technique;
  double mean_kev = 0;        ///< mean signal in the measuring field
  bool is_saturated = false;  ///< it is above what the codes hold
};

/// A frame's optical depths as its detector measured them, up to a constant: for subtraction.
std::vector<float> measured_depths(const FluoroscopyFrame& frame);

/// A fluoroscope from the X-ray tube to the display, with its own memory: lag, temporal filter, exposure
/// control and dose. Pictures are functions of the options, the rays and the pulses before, whatever the
/// number of threads.
class Fluoroscope {
 public:
  /// `view` must be complete; the distances of its cone replace the C-arm's. A parallel view is one of what
  /// lies at the isocentre: on the detector its pixels are larger by the C-arm's magnification. Throws as
  /// `check`, and InputError for a source within 200 mm of the isocentre, or blades that leave no pixel open.
  Fluoroscope(FluoroscopyOptions options, const View& view, WaterPath path);
  ~Fluoroscope();
  Fluoroscope(Fluoroscope&&) noexcept;
  Fluoroscope& operator=(Fluoroscope&&) noexcept;

  /// A pulse through a picture's rays. The frame stays valid until the next call.
  const FluoroscopyFrame& expose(const RayDepths& rays);

  /// Lets the exposure control, unless it is held, settle on a scene, and lag become steady, as after many
  /// pulses. They count no dose.
  void settle(const RayDepths& rays);

  /// Takes effect with the next pulse. Throws as the constructor, and then changes nothing. A view of another
  /// size or zoom clears what earlier frames left; one that the C-arm cannot have turned to meanwhile begins
  /// the display's temporal filter anew.
  void set_view(const View& view);

  /// Another map's. Takes effect with the next pulse.
  void set_path(WaterPath path);

  /// The next pulse is the first one after a pause: lag has decayed, and the display's temporal filter
  /// begins anew.
  void begin_run(double pause_s);

  void set_dose(DoseLevel dose);

  /// Other blades, and another compression of the display's range; none: the C-arm's. Technique, dose and lag
  /// go on. Throws as the constructor, and then changes nothing.
  void set_picture(const std::optional<Collimation>& collimation, std::optional<double> compression);

  /// Whether the exposure control leaves voltage and mAs as they are, as for subtraction.
  void hold_technique(bool is_held);

  const FluoroscopyOptions& options() const;
  const DoseRecord& dose() const;
  Technique technique() const;        ///< of the next pulse
  double kerma_rate_mGy_min() const;  ///< at the reference point
  double target_kev() const;          ///< the exposure control's, as mean signal of a pixel
  double open_quanta() const;         ///< that a pixel of the open field detects in the next pulse
  int bits() const;

  /// The share of the beam that reaches each pixel between the blades, H x W.
  std::span<const float> field() const;

  /// Sets a difference of two frames to 0 behind the blades, where there is only noise. H x W.
  void clear_behind_blades(std::span<float> difference) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace xraycast
