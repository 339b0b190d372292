#pragma once

#include "xraycast/attenuation/spectrum.hpp"

#include <string>

namespace xraycast {

/// The part of a material's mass attenuation that is photoelectric absorption, by xraylib. Names, range and
/// errors as mass_attenuation_cm2_g.
double photoelectric_cm2_g(const std::string& material, double energy_kev);

/// Air's mass energy-transfer coefficient: photoelectric absorption, and the energy that Compton scattering
/// transfers to electrons. Within 2 % of NIST's mass energy-absorption coefficients from 10 to 150 keV.
double air_energy_transfer_cm2_g(double energy_kev);

/// Air kerma in uGy of a fluence in photons per cm2.
double air_kerma_uGy(const Spectrum& fluence_cm2);

}  // namespace xraycast
