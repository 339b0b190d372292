#pragma once

#include "xraycast/fluoroscope/scintillator_blur.hpp"
#include "xraycast/projection/view.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Tube and generator of a C-arm.
struct XrayTube {
  double focal_spot_mm = 0;                ///< nominal, width at half maximum
  double aluminium_mm = 0, copper_mm = 0;  ///< added to the inherent 2.5 mm of aluminium
  double lowest_kvp = 0, highest_kvp = 0;  ///< kLowestTube_kv to kHighestTube_kv
  double lowest_ma = 0, highest_ma = 0, power_kw = 0;
  double pulse_ms = 0;
};

/// Charge that a detector keeps: this fraction of every frame's signal, which comes out again exponentially.
struct LagTrap {
  double fraction = 0, time_s = 0;
};

/// An energy-integrating detector with a caesium iodide scintillator.
struct FluoroscopyDetector {
  double width_mm = 0, height_mm = 0, pixel_mm = 0;
  bool is_round = false;          ///< an image intensifier
  double scintillator_g_cm2 = 0;  ///< of caesium iodide
  double cover_mm = 0;            ///< of aluminium
  int bits = 14;
  double electronic_noise_kev = 0;  ///< rms of a pixel, as absorbed energy
  ScintillatorBlur blur;
  std::vector<LagTrap> lag;
};

/// The share that an antiscatter grid transmits.
struct AntiscatterGrid {
  double primary = 1, scatter = 1;
};

/// Air kerma at the detector in uGy a pulse that the exposure control aims at, in the largest field.
struct DetectorDose {
  double low_uGy = 0, normal_uGy = 0, cine_uGy = 0;
};

/// A C-arm: what its data sheet says, and what physicists measured of its kind.
struct CArm {
  std::string name;
  Cone distances{};
  XrayTube tube;
  double table_mm = 0;  ///< the tabletop's equivalent in aluminium
  std::optional<AntiscatterGrid> grid;
  FluoroscopyDetector detector;
  DetectorDose dose;
  double compression = 0;         ///< of the display's range, 0 to 1: see DynamicRange
  std::vector<double> fields_mm;  ///< zoom fields, the largest first: sides of squares on the detector

  /// Throws InputError naming `origin` and the field.
  static CArm from_json(const std::string& text, const std::string& origin);

  /// A preset by its name, or a JSON file. Throws InputError.
  static CArm named(const std::string& name_or_file);
  static std::vector<std::string> preset_names();
};

/// The field of that side, or the largest for none. Throws InputError, listing the C-arm's fields.
double zoom_field_mm(const CArm& c_arm, std::optional<double> field_mm);

/// The focal spot's spread on the detector, by the magnification of what lies at the isocentre.
double focal_spread_mm(const CArm& c_arm);

/// Sets what the view leaves open: the cone's distances, and size and pixel for the field: the detector's
/// pixels, two by two where the field has more than 1280 a side.
View view_of(const CArm& c_arm, double field_mm, View view);

}  // namespace xraycast
