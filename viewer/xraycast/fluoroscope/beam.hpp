#pragma once

#include "xraycast/fluoroscope/detected_spectrum.hpp"
#include "xraycast/fluoroscope/exposure.hpp"
#include "xraycast/fluoroscope/pixel_loops.hpp"
#include "xraycast/fluoroscope/water_path.hpp"

namespace xraycast {

/// The beam of one tube voltage as a detector's pixels see it.
struct FluoroscopyBeam {
  DetectedSpectrum spectrum;
  EnergyMoments open;  ///< of the open field, a cm2 and mAs
  double reference_uGy_per_mas = 0, limited_uGy_per_mas = 0;

  /// Of a picture's optical depths.
  QuantaTable table(const WaterPath& path) const;

  /// Of the C-arm's tube. Air kerma is that at the reference point, and at the point where its rate is
  /// limited, 30 cm from the detector (21 CFR 1020.32).
  FluoroscopyBeam(const CArm& c_arm, int kvp);

  /// Of any spectrum at the detector, without air kerma. Throws InputError where the detector absorbs nothing
  /// of it.
  FluoroscopyBeam(const CArm& c_arm, const Spectrum& spectrum);

  /// Of a spectrum that is known, with its air kerma.
  FluoroscopyBeam(DetectedSpectrum detected, double reference, double limited);
};

/// The energy in keV that a cm2 of the detector absorbs an uGy of air kerma, behind a patient: at the
/// radiation quality RQA 5 of IEC 61267, 70 kV behind 21 mm of aluminium.
double absorbed_kev_per_uGy(const FluoroscopyDetector& detector);

}  // namespace xraycast
