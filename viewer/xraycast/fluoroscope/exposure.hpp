#pragma once

#include "xraycast/attenuation/tube_spectrum.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"

#include <string>

namespace xraycast {

/// The technique of a pulse.
struct Technique {
  int kvp = 0;
  double mas = 0;
  bool operator==(const Technique&) const = default;
};

/// The detector's target of dose a pulse.
enum class DoseLevel { low, normal, cine };

std::string to_string(DoseLevel dose);

/// Counted since the patient's examination began.
struct DoseRecord {
  double air_kerma_mGy = 0;  ///< at the patient entrance reference point
  double dap_Gycm2 = 0;      ///< dose-area product
  double fluoroscopy_s = 0;  ///< at the low and the normal level
  long long images = 0;      ///< recorded ones, at the cine level
  long long pulses = 0;      ///< of both
};

/// The patient entrance reference point of IEC 60601-2-43: on the beam's axis, 15 cm from the isocentre
/// towards the source. Its distance from the source.
double reference_distance_mm(const CArm& c_arm);

/// Air kerma in uGy a mAs, free in air behind the tube's filters, at a distance from the focal spot.
double air_kerma_uGy_per_mas(const XrayTube& tube, int kvp, double distance_mm);

/// The same beam at the detector with no patient: behind the tabletop and the grid, as photons per cm2 and
/// mAs.
Spectrum open_beam(const CArm& c_arm, int kvp);

/// The longest pulse's mAs at a voltage: the tube's current or the generator's power limits it.
double highest_mas(const XrayTube& tube, int kvp);
double lowest_mas(const XrayTube& tube);

}  // namespace xraycast
