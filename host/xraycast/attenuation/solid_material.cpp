#include "xraycast/attenuation/solid_material.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/printable.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <xraylib.h>

namespace xraycast {
namespace {

/// Middles of the standards' ranges; what they limit to less than 1 % is left out.
const std::vector<SolidMaterial>& known_solids() {
  static const std::vector<SolidMaterial> solids{
      {"titanium", 4.51, {{"Ti", 1}}},
      {"titanium-alloy", 4.43, {{"Ti", 0.90}, {"Al", 0.06}, {"V", 0.04}}},                        // ASTM F136
      {"steel", 7.99, {{"Fe", 0.635}, {"Cr", 0.18}, {"Ni", 0.14}, {"Mo", 0.025}, {"Mn", 0.02}}},  // ASTM F138
      {"cobalt-chrome", 8.3, {{"Co", 0.66}, {"Cr", 0.28}, {"Mo", 0.06}}},                         // ASTM F75
      {"nitinol", 6.45, {{"Ni", 0.558}, {"Ti", 0.442}}},  // ASTM F2063
      {"tantalum", 16.65, {{"Ta", 1}}},
      {"tungsten", 19.25, {{"W", 1}}},
      {"platinum", 21.45, {{"Pt", 1}}},
      {"platinum-iridium", 21.55, {{"Pt", 0.9}, {"Ir", 0.1}}},
      {"gold", 19.3, {{"Au", 1}}},
      {"alumina", 3.97, {{"Al", 0.529}, {"O", 0.471}}},
      {"polyethylene", 0.94, {{"C", 0.8563}, {"H", 0.1437}}},
      {"bone-cement",
       1.25,
       {{"C", 0.54}, {"O", 0.335}, {"H", 0.0725}, {"Zr", 0.0525}}},  // a tenth of zirconia
  };
  return solids;
}

/// Elements of a symbol, a name of NIST's list or a formula; of the first two, with a density.
std::optional<SolidMaterial> solid_of_xraylib(const std::string& name) {
  const auto parts_of = [](int count, const int* elements, const double* fractions) {
    std::vector<SolidMaterial::Part> parts;
    for (int i = 0; i < count; ++i) {
      const std::unique_ptr<char, decltype(&xrlFree)> symbol(AtomicNumberToSymbol(elements[i], nullptr),
                                                             &xrlFree);
      parts.push_back({symbol.get(), fractions[i]});
    }
    return parts;
  };
  if (const int z = SymbolToAtomicNumber(name.c_str(), nullptr); z > 0)
    return SolidMaterial{name, ElementDensity(z, nullptr), {{name, 1}}};
  if (const std::unique_ptr<compoundDataNIST, decltype(&FreeCompoundDataNIST)> nist(
          GetCompoundDataNISTByName(name.c_str(), nullptr), &FreeCompoundDataNIST);
      nist)
    return SolidMaterial{name, nist->density, parts_of(nist->nElements, nist->Elements, nist->massFractions)};
  if (const std::unique_ptr<compoundData, decltype(&FreeCompoundData)> formula(
          CompoundParser(name.c_str(), nullptr), &FreeCompoundData);
      formula)
    return SolidMaterial{name, 0, parts_of(formula->nElements, formula->Elements, formula->massFractions)};
  return std::nullopt;
}

}  // namespace

double SolidMaterial::cm2_g(double energy_kev) const {
  double sum = 0;
  for (const Part& part : parts) sum += part.mass_fraction * mass_attenuation_cm2_g(part.element, energy_kev);
  return sum;
}

std::vector<std::string> solid_names() {
  std::vector<std::string> names;
  for (const SolidMaterial& solid : known_solids()) names.push_back(solid.name);
  return names;
}

SolidMaterial solid_named(const std::string& name, std::optional<double> g_cm3) {
  const auto known = std::find_if(known_solids().begin(), known_solids().end(),
                                  [&](const SolidMaterial& solid) { return solid.name == name; });
  std::optional<SolidMaterial> solid = known != known_solids().end() ? *known : solid_of_xraylib(name);
  if (!solid)
    throw InputError(
        "material {}: unknown; give {}, an element's symbol, or a formula such as Al2O3 with a density",
        excerpt(name), fmt::join(solid_names(), ", "));
  if (g_cm3) solid->g_cm3 = *g_cm3;
  constexpr double kLeast = 0.01, kMost = 25;
  if (solid->g_cm3 == 0)
    throw InputError("material {}: a formula has no density; give it too, in g/cm3", excerpt(name));
  if (!(solid->g_cm3 >= kLeast && solid->g_cm3 <= kMost))
    throw InputError("material {}: a density of {:g} g/cm3; must be {:g} to {:g}", excerpt(name),
                     solid->g_cm3, kLeast, kMost);
  return *std::move(solid);
}

}  // namespace xraycast
