#include "xraycast/fluoroscope/beam.hpp"

#include "xraycast/attenuation/absorption.hpp"
#include "xraycast/base/error.hpp"

#include <algorithm>

namespace xraycast {

FluoroscopyBeam::FluoroscopyBeam(const CArm& c_arm, const Spectrum& at_detector)
    : spectrum(at_detector, c_arm.detector), open(spectrum.behind_water(0)) {
  constexpr double kLeastShare = 1e-6;
  double photons = 0;
  for (const auto& bin : at_detector.bins()) photons += bin.fluence;
  if (!(open.m0 > kLeastShare * photons))
    throw InputError("{}: the detector of {} absorbs none of these photons; give a harder spectrum",
                     at_detector.name(), c_arm.name);
}

FluoroscopyBeam::FluoroscopyBeam(const CArm& c_arm, int kvp) : FluoroscopyBeam(c_arm, open_beam(c_arm, kvp)) {
  constexpr double kMetre_mm = 1000, kFromDetector_mm = 300, kLeast_mm = 100;
  const double at_metre_uGy = air_kerma_uGy_per_mas(c_arm.tube, kvp, kMetre_mm);
  const auto at_uGy = [&](double distance_mm) {
    const double closer = kMetre_mm / distance_mm;
    return closer * closer * at_metre_uGy;
  };
  reference_uGy_per_mas = at_uGy(reference_distance_mm(c_arm));
  limited_uGy_per_mas = at_uGy(std::max(kLeast_mm, c_arm.distances.source_detector_mm - kFromDetector_mm));
}

QuantaTable FluoroscopyBeam::table(const WaterPath& path) const {
  constexpr int kStepsPerTau = 32, kMostTau = 24;
  QuantaTable table;
  table.steps_per_tau = kStepsPerTau;
  for (int step = 0; step <= kStepsPerTau * kMostTau; ++step) {
    const EnergyMoments behind = spectrum.behind_water(path.g_cm2(1.0 * step / kStepsPerTau));
    table.steps.push_back({static_cast<float>(behind.m0 / open.m0), static_cast<float>(behind.mean_kev()),
                           static_cast<float>(behind.spread_kev())});
  }
  return table;
}

double absorbed_kev_per_uGy(const FluoroscopyDetector& detector) {
  constexpr int kTube_kv = 70;
  const Spectrum quality = tube_spectrum(kTube_kv, {.aluminium_mm = 21});
  return DetectedSpectrum(quality, detector).behind_water(0).m1 / air_kerma_uGy(quality);
}

}  // namespace xraycast
