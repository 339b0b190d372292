#include "xraycast/fluoroscope/exposure.hpp"

#include "xraycast/attenuation/absorption.hpp"

#include <algorithm>
#include <vector>

namespace xraycast {
namespace {

constexpr double kMetre_mm = 1000;

}  // namespace

std::string to_string(DoseLevel dose) {
  return dose == DoseLevel::low ? "low" : dose == DoseLevel::normal ? "normal" : "cine";
}

double reference_distance_mm(const CArm& c_arm) {
  constexpr double kTowardsSource_mm = 150;
  return c_arm.distances.source_axis_mm - kTowardsSource_mm;
}

double air_kerma_uGy_per_mas(const XrayTube& tube, int kvp, double distance_mm) {
  const double closer = kMetre_mm / distance_mm;
  return closer * closer * air_kerma_uGy(tube_spectrum(kvp, {tube.aluminium_mm, tube.copper_mm}));
}

Spectrum open_beam(const CArm& c_arm, int kvp) {
  const XrayTube& tube = c_arm.tube;
  const Spectrum at_metre = tube_spectrum(kvp, {tube.aluminium_mm + c_arm.table_mm, tube.copper_mm});
  const double closer = kMetre_mm / c_arm.distances.source_detector_mm;
  const double passed = closer * closer * (c_arm.grid ? c_arm.grid->primary : 1);
  std::vector<Spectrum::Bin> bins(at_metre.bins().begin(), at_metre.bins().end());
  for (auto& bin : bins) bin.fluence *= passed;
  return {at_metre.name(), std::move(bins)};
}

double highest_mas(const XrayTube& tube, int kvp) {
  return std::min(tube.highest_ma, 1000 * tube.power_kw / kvp) * tube.pulse_ms / 1000;
}

double lowest_mas(const XrayTube& tube) { return tube.lowest_ma * tube.pulse_ms / 1000; }

}  // namespace xraycast
