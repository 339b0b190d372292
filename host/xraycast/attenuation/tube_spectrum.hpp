#pragma once

#include "xraycast/attenuation/spectrum.hpp"

namespace xraycast {

/// Metal in the beam besides the tube's inherent 2.5 mm of aluminium.
struct BeamFilter {
  double aluminium_mm = 0, copper_mm = 0;
};

inline constexpr int kLowestTube_kv = 40, kHighestTube_kv = 150;

/// What an X-ray tube emits at a constant voltage, behind its inherent and the added filter: photons per cm2
/// and mAs at 1 m from the focal spot, in bins of 1 keV. The model is that of Spectrum::named, without the
/// heel effect. Throws InputError outside 40 to 150 kV.
Spectrum tube_spectrum(int tube_kv, const BeamFilter& added = {});

}  // namespace xraycast
