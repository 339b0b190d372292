#pragma once

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"

#include <array>
#include <span>
#include <utility>
#include <vector>

namespace xraycast {

/// Moments of the energies that a detector absorbs: the quanta, their energy in keV, and its square's sum.
/// Signals have the mean N m1 / m0 and the variance N m2 / m0 for N quanta.
struct EnergyMoments {
  double m0 = 0, m1 = 0, m2 = 0;
  double mean_kev() const { return m0 > 0 ? m1 / m0 : 0; }
  double spread_kev() const;
};

/// The photons of a beam that a detector absorbs, all their energy at once: photoelectrically, in its layer
/// of caesium iodide behind its cover, by xraylib. What leaves the layer again as characteristic radiation,
/// and the little that Compton scattering deposits, are left out.
class DetectedSpectrum {
 public:
  /// Photons of one energy that the detector absorbs where nothing is in the beam, in the beam's own unit of
  /// fluence, and mu/rho of each of kMaterials.
  struct Bin {
    double energy_kev, absorbed;
    std::array<double, kMaterials.size()> cm2_g;
  };

  DetectedSpectrum(const Spectrum& beam, const FluoroscopyDetector& detector);
  explicit DetectedSpectrum(std::vector<Bin> bins) : bins_(std::move(bins)) {}

  std::span<const Bin> bins() const { return bins_; }

  /// Of the beam behind masses of kMaterials in g/cm2, and behind solids with an optical depth of their own
  /// in each bin, if any; the sums are in the beam's own unit of fluence.
  EnergyMoments behind(const std::array<double, kMaterials.size()>& g_cm2,
                       std::span<const double> solids = {}) const;
  EnergyMoments behind_water(double g_cm2) const { return behind({g_cm2}); }

 private:
  std::vector<Bin> bins_;
};

}  // namespace xraycast
