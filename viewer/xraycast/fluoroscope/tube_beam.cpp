// The beams of X-ray tubes, by xraylib. A page has them in numbers instead (web/native/tube_beam.cpp).
#include "xraycast/attenuation/absorption.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/fluoroscope/beam.hpp"

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
  constexpr double kOneMetre_mm = 1000, kFromDetector_mm = 300, kLeast_mm = 100;
  const double at_metre_uGy = air_kerma_uGy_per_mas(c_arm.tube, kvp, kOneMetre_mm);
  const auto at_uGy = [&](double distance_mm) {
    const double closer = kOneMetre_mm / distance_mm;
    return closer * closer * at_metre_uGy;
  };
  reference_uGy_per_mas = at_uGy(reference_distance_mm(c_arm));
  limited_uGy_per_mas = at_uGy(std::max(kLeast_mm, c_arm.distances.source_detector_mm - kFromDetector_mm));
}

double absorbed_kev_per_uGy(const FluoroscopyDetector& detector) {
  constexpr int kTube_kv = 70;
  const Spectrum quality = tube_spectrum(kTube_kv, {.aluminium_mm = 21});
  return DetectedSpectrum(quality, detector).behind_water(0).m1 / air_kerma_uGy(quality);
}

}  // namespace xraycast
