#include "xraycast/fluoroscope/beam.hpp"

#include <utility>

namespace xraycast {

FluoroscopyBeam::FluoroscopyBeam(DetectedSpectrum detected, double reference, double limited)
    : spectrum(std::move(detected)),
      open(spectrum.behind_water(0)),
      reference_uGy_per_mas(reference),
      limited_uGy_per_mas(limited) {}

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

}  // namespace xraycast
