#include "xraycast/attenuation/materials.hpp"

#include "xraycast/attenuation/absorption.hpp"
#include "xraycast/base/error.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <xraylib.h>

namespace xraycast {
namespace {

constexpr double kBone_g_cm3 = 1.85;  // cortical, ICRP

std::string text_of(const VolumeGeometry& grid) {
  return fmt::format("{} x {} x {} voxels of {:.4g} x {:.4g} x {:.4g} mm from ({:.2f}, {:.2f}, {:.2f}) mm",
                     grid.size.x, grid.size.y, grid.size.z, grid.spacing_mm.x, grid.spacing_mm.y,
                     grid.spacing_mm.z, grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z);
}

/// One of xraylib's functions of an element and an energy.
using ElementCoefficient = double (*)(int atomic_number, double energy_kev, xrl_error** error);

double element_cm2_g(ElementCoefficient coefficient, int atomic_number, double energy_kev) {
  xrl_error* error = nullptr;
  const double cm2_g = coefficient(atomic_number, energy_kev, &error);
  if (error) {
    const std::string message = error->message;
    xrl_error_free(error);
    throw Error("element {} at {} keV: xraylib: {}", atomic_number, energy_kev, message);
  }
  return cm2_g;
}

// Element by element, because xraylib 4.0.0 leaks memory on every call of its functions for compounds.
double material_cm2_g(ElementCoefficient coefficient, const std::string& material, double energy_kev) {
  if (const int z = SymbolToAtomicNumber(material.c_str(), nullptr); z > 0)
    return element_cm2_g(coefficient, z, energy_kev);
  const std::unique_ptr<compoundDataNIST, decltype(&FreeCompoundDataNIST)> compound(
      GetCompoundDataNISTByName(material.c_str(), nullptr), &FreeCompoundDataNIST);
  if (!compound) throw Error("{}: neither an element nor a compound in NIST's list", material);
  double sum = 0;
  for (int i = 0; i < compound->nElements; ++i)
    sum += compound->massFractions[i] * element_cm2_g(coefficient, compound->Elements[i], energy_kev);
  return sum;
}

}  // namespace

double mass_attenuation_cm2_g(const std::string& material, double energy_kev) {
  return material_cm2_g(&CS_Total, material, energy_kev);
}

double photoelectric_cm2_g(const std::string& material, double energy_kev) {
  return material_cm2_g(&CS_Photo, material, energy_kev);
}

namespace {

/// The mean share of its energy that a photon hands to an electron in Compton scattering, by Klein and
/// Nishina (R. D. Evans, The atomic nucleus, 1955, chapter 23).
double compton_transfer(double energy_kev) {
  const double a = energy_kev / MEC2, b = 1 + 2 * a, log_b = std::log(b);
  const double all =
      2 * ((1 + a) / (a * a) * (2 * (1 + a) / b - log_b / a) + log_b / (2 * a) - (1 + 3 * a) / (b * b));
  const double scattered = log_b / (a * a * a) + 2 * (1 + a) * (2 * a * a - 2 * a - 1) / (a * a * b * b) +
                           8 * a * a / (3 * b * b * b);
  return 1 - scattered / all;
}

}  // namespace

// Not by xraylib's mass energy-absorption coefficients, which below 60 keV lie far below NIST's.
double air_energy_transfer_cm2_g(double energy_kev) {
  const char* const air = "Air, Dry (near sea level)";
  return material_cm2_g(&CS_Photo, air, energy_kev) +
         material_cm2_g(&CS_Compt, air, energy_kev) * compton_transfer(energy_kev);
}

double air_kerma_uGy(const Spectrum& fluence_cm2) {
  constexpr double kKevPerGram_uGy = 1.602177e-7;
  double kev_g = 0;
  for (const auto& [energy_kev, fluence] : fluence_cm2.bins())
    if (fluence > 0) kev_g += fluence * energy_kev * air_energy_transfer_cm2_g(energy_kev);
  return kKevPerGram_uGy * kev_g;
}

std::array<Opacity, kMaterials.size()> material_contents() {
  constexpr double kScanner_kev = 70, kSoftTissueHu = 100;
  const auto at_scanner = [](const Material& material) {
    return mass_attenuation_cm2_g(material.xraylib_name, kScanner_kev);
  };
  const double water_cm2_g = at_scanner(kMaterials[0]), bone_cm2_g = at_scanner(kMaterials[1]),
               iodine_cm2_g = at_scanner(kMaterials[2]);
  const double bone_hu = 1000 * (kBone_g_cm3 * bone_cm2_g / water_cm2_g - 1);
  constexpr double kCm_per_mm = 0.1;
  const auto water = [](double hu) { return kCm_per_mm * (1 + hu / 1000); };
  const auto bone = [&](double hu) { return water(hu) * water_cm2_g / bone_cm2_g; };
  const double iodine_per_hu = kCm_per_mm * water_cm2_g / iodine_cm2_g / 1000;
  return {Opacity("water", {{-1000, 0}, {kSoftTissueHu, water(kSoftTissueHu)}, {bone_hu, 0}}),
          Opacity("bone", {{kSoftTissueHu, 0}, {bone_hu, bone(bone_hu)}, {kMaxHu, bone(kMaxHu)}}),
          Opacity("iodine", {{0, 0}, {kMaxHu, iodine_per_hu * kMaxHu}})};
}

void check_mask_grid(const VolumeGeometry& mask, const VolumeGeometry& scan, const std::string& name) {
  constexpr double kTolerance = 0.01;  // of a voxel; file formats round to 32 bits
  const auto meets = [&](const glm::dvec3& a_mm, const glm::dvec3& b_mm) {
    return glm::all(glm::lessThan(glm::abs(a_mm - b_mm), kTolerance * scan.spacing_mm));
  };
  if (mask.size != scan.size || !meets(mask.lower_mm(), scan.lower_mm()) ||
      !meets(mask.upper_mm(), scan.upper_mm()))
    throw InputError("{}: has {}, but the scan has {}; a mask must lie on the scan's grid", name,
                     text_of(mask), text_of(scan));
}

Volume take_contrast(Volume& scan, Volume mask) {
  check_mask_grid(mask.geometry(), scan.geometry(), "vessel mask");
  constexpr auto kBlood = static_cast<std::int16_t>(kBloodHu);
  std::ranges::transform(scan.hu(), mask.hu(), mask.hu().begin(), [](std::int16_t hu, std::int16_t vessel) {
    return static_cast<std::int16_t>(vessel > 0 ? std::max(hu - kBlood, 0) : 0);
  });
  std::ranges::transform(
      scan.hu(), mask.hu(), scan.hu().begin(),
      [](std::int16_t hu, std::int16_t enhancement) { return static_cast<std::int16_t>(hu - enhancement); });
  return mask;
}

}  // namespace xraycast
