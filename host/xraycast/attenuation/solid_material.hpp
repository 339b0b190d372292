#pragma once

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What implants and devices are made of: a density, and the mass fractions of its elements.
struct SolidMaterial {
  struct Part {
    std::string element;  ///< its symbol
    double mass_fraction;
    bool operator==(const Part&) const = default;
  };
  std::string name;
  double g_cm3 = 1;
  std::vector<Part> parts;

  /// The mass attenuation coefficient mu/rho, coherent scattering included, by xraylib; energies are 1 to 800
  /// keV. Throws Error for others.
  double cm2_g(double energy_kev) const;

  bool operator==(const SolidMaterial&) const = default;
};

/// The names that solid_named knows: `titanium`, `steel` and so on.
std::vector<std::string> solid_names();

/// One of solid_names(), an element's symbol, a chemical formula such as `Al2O3`, or a name of NIST's list of
/// compounds, as xraylib has them. Formulas have no density of their own. Throws InputError, with the names
/// that there are, for others, for a density that is not 0.01 to 25 g/cm3, and for a formula without one.
SolidMaterial solid_named(const std::string& name, std::optional<double> g_cm3 = {});

}  // namespace xraycast
