#include "xraycast/fluoroscope/detected_spectrum.hpp"

#include "xraycast/attenuation/absorption.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

double EnergyMoments::spread_kev() const {
  return m0 > 0 ? std::sqrt(std::max(0.0, m2 / m0 - mean_kev() * mean_kev())) : 0;
}

DetectedSpectrum::DetectedSpectrum(const Spectrum& beam, const FluoroscopyDetector& detector) {
  constexpr double kAluminium_g_cm2_per_mm = 0.2699, kLeastShare = 1e-9;
  double most = 0;
  for (const auto& bin : beam.bins()) most = std::max(most, bin.fluence);
  for (const auto& [energy_kev, fluence] : beam.bins()) {
    if (fluence <= kLeastShare * most) continue;
    const double cover =
        detector.cover_mm * kAluminium_g_cm2_per_mm * mass_attenuation_cm2_g("Al", energy_kev);
    const double layer = detector.scintillator_g_cm2 * photoelectric_cm2_g("Cesium Iodide", energy_kev);
    Bin bin{energy_kev, fluence * std::exp(-cover) * -std::expm1(-layer), {}};
    for (std::size_t m = 0; m < kMaterials.size(); ++m)
      bin.cm2_g[m] = mass_attenuation_cm2_g(kMaterials[m].xraylib_name, energy_kev);
    bins_.push_back(bin);
  }
}

EnergyMoments DetectedSpectrum::behind(const std::array<double, kMaterials.size()>& g_cm2,
                                       std::span<const double> solids) const {
  EnergyMoments sum;
  for (std::size_t b = 0; b < bins_.size(); ++b) {
    const Bin& bin = bins_[b];
    double depth = solids.empty() ? 0 : solids[b];
    for (std::size_t m = 0; m < g_cm2.size(); ++m) depth += bin.cm2_g[m] * g_cm2[m];
    const double quanta = bin.absorbed * std::exp(-depth);
    sum.m0 += quanta;
    sum.m1 += quanta * bin.energy_kev;
    sum.m2 += quanta * bin.energy_kev * bin.energy_kev;
  }
  return sum;
}

}  // namespace xraycast
