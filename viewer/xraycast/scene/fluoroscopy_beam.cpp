#include "xraycast/scene/fluoroscopy_beam.hpp"

#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/attenuation/spectrum.hpp"

#include <array>
#include <cmath>

namespace xraycast {

double fluoroscopy_per_mm(const std::string& element, double mg_ml) {
  constexpr double kTrunk_g_cm2 = 20, kLittle_g_cm2 = 1e-4, kWater_per_mm = 0.02;
  const std::array<Material, 2> materials{{{"water", "Water, Liquid"}, {"element", element.c_str()}}};
  const SpectrumModel beam(Spectrum::named("80"), materials);
  const auto tau = [&](double water_g_cm2, double element_g_cm2) {
    return -std::log(beam.transmission(std::array{water_g_cm2, element_g_cm2}));
  };
  const double before = tau(kTrunk_g_cm2, 0);
  const double of_water = tau(kTrunk_g_cm2 + kLittle_g_cm2, 0) - before;
  const double of_element = tau(kTrunk_g_cm2, kLittle_g_cm2) - before;
  constexpr double kWater_mg_ml = 1000;
  return kWater_per_mm * of_element / of_water * mg_ml / kWater_mg_ml;
}

double fluoroscopy_per_mm(const SolidMaterial& solid) {
  constexpr double kMgPerG = 1000;
  double per_mm = 0;
  for (const SolidMaterial::Part& part : solid.parts)
    per_mm += fluoroscopy_per_mm(part.element, kMgPerG * solid.g_cm3 * part.mass_fraction);
  return per_mm;
}

}  // namespace xraycast
