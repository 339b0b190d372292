#pragma once

#include "xraycast/attenuation/spectrum.hpp"

#include <string>

namespace xraycast {

/// The part of a material's mass attenuation that is photoelectric absorption, by xraylib. Names, range and
/// errors as mass_attenuation_cm2_g.
double photoelectric_cm2_g(const std::string& material, double energy_kev);

/// Air kerma in uGy of a fluence in photons per cm2: the sum over the bins of fluence, energy, and air's mass
/// energy-absorption coefficient by xraylib, which at these energies is its energy-transfer coefficient to
/// within 0.1 %.
double air_kerma_uGy(const Spectrum& fluence_cm2);

}  // namespace xraycast
