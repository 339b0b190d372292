#include "xraycast/fluoroscope/beam.hpp"

#include "xraycast/attenuation/absorption.hpp"

namespace xraycast {
namespace {

QuantaTable table_of(const DetectedSpectrum& spectrum, const WaterPath& path) {
  constexpr int kStepsPerTau = 32, kMostTau = 24;
  QuantaTable table;
  table.steps_per_tau = kStepsPerTau;
  const double open = spectrum.behind_water(0).m0;
  for (int step = 0; step <= kStepsPerTau * kMostTau; ++step) {
    const EnergyMoments behind = spectrum.behind_water(path.g_cm2(1.0 * step / kStepsPerTau));
    table.share.push_back(static_cast<float>(behind.m0 / open));
    table.mean_kev.push_back(static_cast<float>(behind.mean_kev()));
    table.spread_kev.push_back(static_cast<float>(behind.spread_kev()));
  }
  return table;
}

}  // namespace

FluoroscopyBeam::FluoroscopyBeam(const CArm& c_arm, const Spectrum& at_detector, const WaterPath& path)
    : spectrum(at_detector, c_arm.detector),
      open(spectrum.behind_water(0)),
      table(table_of(spectrum, path)) {}

FluoroscopyBeam::FluoroscopyBeam(const CArm& c_arm, int kvp, const WaterPath& path)
    : FluoroscopyBeam(c_arm, open_beam(c_arm, kvp), path) {
  constexpr double kFromDetector_mm = 300;
  reference_uGy_per_mas = air_kerma_uGy_per_mas(c_arm.tube, kvp, reference_distance_mm(c_arm));
  limited_uGy_per_mas = air_kerma_uGy_per_mas(
      c_arm.tube, kvp, std::max(100.0, c_arm.distances.source_detector_mm - kFromDetector_mm));
}

double absorbed_kev_per_uGy(const FluoroscopyDetector& detector) {
  constexpr int kTube_kv = 70;
  const Spectrum quality = tube_spectrum(kTube_kv, {.aluminium_mm = 21});
  return DetectedSpectrum(quality, detector).behind_water(0).m1 / air_kerma_uGy(quality);
}

}  // namespace xraycast
