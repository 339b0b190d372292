#pragma once

#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"
#include "xraycast/fluoroscope/collimation.hpp"
#include "xraycast/fluoroscope/exposure.hpp"
#include "xraycast/fluoroscope/stages.hpp"

#include <cstdint>
#include <optional>

namespace xraycast {

/// What is set on a fluoroscope's console.
struct FluoroscopyOptions {
  CArm c_arm;
  double field_mm = 0;  ///< zoom field that limits the beam; 0: as large as the picture
  std::optional<Collimation> collimation{};
  DoseLevel dose = DoseLevel::normal;
  std::optional<int> kvp{};     ///< held by the exposure control
  std::optional<double> mas{};  ///< a pulse; held by the exposure control
  std::optional<double>
      photons{};  ///< quanta that a pixel of the open field detects, in place of an exposure
  std::optional<Spectrum> spectrum{};  ///< in place of the tube's; needs `photons`
  double pulses_per_s = 15;
  std::optional<double> compression{};  ///< of the display's range, 0 to 1; none: the C-arm's
  FluoroscopyStages stages{};
  std::uint32_t seed = 1;

  double range_compression() const { return compression.value_or(c_arm.compression); }

  /// Whether the exposure control chooses voltage or mAs.
  bool is_automatic() const { return !photons && !(kvp && mas); }
};

/// Throws InputError for an exposure of zero or without bound, a voltage outside the tube's range, a shut
/// collimator, a pulse rate outside 3 to 30/s, or a compression outside 0 to 1.
void check(const FluoroscopyOptions& options);

}  // namespace xraycast
