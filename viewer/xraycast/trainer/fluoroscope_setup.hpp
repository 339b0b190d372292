#pragma once

#include "xraycast/fluoroscope/beam.hpp"
#include "xraycast/fluoroscope/fluoroscopy_options.hpp"
#include "xraycast/projection/view.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// The beams of a C-arm's tube, one a kV, for a page, which has no cross sections.
struct TubeBeams {
  double absorbed_kev_per_uGy = 0;  ///< see the function of that name
  int lowest_kvp = 0;
  std::vector<FluoroscopyBeam> beams{};  ///< of whole kV from there on

  /// Throws Error for a voltage that they have not.
  const FluoroscopyBeam& at(int kvp) const;
};

/// The fluoroscope of a page without a server: all that decides its pictures but the rays.
struct FluoroscopeSetup {
  FluoroscopyOptions options{};
  double water_per_mm = 0;  ///< of the map's optical depths, see WaterPath
  TubeBeams beams{};
};

/// With the beams of the tube of `options`.
FluoroscopeSetup fluoroscope_setup(const FluoroscopyOptions& options, double water_per_mm);

/// Its numbers. In order: those of the C-arm, of its traps for charge and of its zoom fields, each list
/// behind its length; zoom field, dose level, pulses a second, seed and the C-arm's compression; the water's
/// value per mm; and the beams: the energy that a cm2 absorbs an uGy, the lowest voltage, how many beams, the
/// number of energies, the first one in keV, others 1 keV apart, water's mu/rho at each; and of each beam air
/// kerma in uGy a mAs at the reference point and where its rate is limited, number of the first energy, their
/// number, and the photons a cm2 and mAs that the detector absorbs at each, as floats. The C-arm's name,
/// blades, an exposure by hand and stages are not among them.
std::vector<double> packed(const FluoroscopeSetup& setup);

/// Throws InputError where numbers are missing, and as `check`.
FluoroscopeSetup fluoroscope_setup_of(std::span<const double> numbers);

/// Of a pulse: the C-arm's angles in rad, the centre in mm, width and height in pixels, their size in mm, and
/// the distances of the cone, or 0 and 0 where rays are parallel.
View pulse_view_of(std::span<const double, 10> numbers);

}  // namespace xraycast
