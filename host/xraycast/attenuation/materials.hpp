#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/volume/volume.hpp"

#include <array>
#include <string>
#include <vector>

namespace xraycast {

/// A material with an attenuation spectrum of its own.
struct Material {
  const char* name;          ///< of its channel in files
  const char* xraylib_name;  ///< as mass_attenuation_cm2_g() knows it
};

/// The materials of a scan, in the order of every list with one value per material.
inline constexpr std::array<Material, 3> kMaterials{{
    {"water", "Water, Liquid"},
    {"bone", "Bone, Cortical (ICRP)"},
    {"iodine", "I"},
}};

/// Mass per area (g/cm2) of each of kMaterials along rays: one value per ray and material.
using MaterialDepths = std::array<std::vector<float>, kMaterials.size()>;

/// The mass attenuation coefficient mu/rho of a material, coherent scattering included, by xraylib
/// (T. Schoonjans et al., Spectrochim. Acta B 66, 2011, 776-784). `material` is an element's symbol or
/// a name of NIST's list of compounds; energies are 1 to 800 keV. Throws Error for others.
double mass_attenuation_cm2_g(const std::string& material, double energy_kev);

/// The CT number of blood without contrast agent.
inline constexpr double kBloodHu = 45;

/// The amount of each of kMaterials in a voxel as a function of its CT number: piecewise linear as an
/// opacity, but in g/cm2 per mm of path instead of 1/mm. Water and bone come from a scan without contrast
/// agent, iodine from its enhancement (see take_contrast).
///
/// Up to 100 HU matter is water of the density given by its CT number, from there to cortical bone (1.85
/// g/cm3; 1445 HU) a mixture by volume of the two, as W. Schneider, T. Bortfeld and W. Schlegel mix their
/// tissues (Phys. Med. Biol. 45, 2000, 459-478), and above it denser bone. Iodine adds 26 HU per mg/ml. The
/// CT numbers are taken as measured at 70 keV, the effective energy of a scan at 120 kVp: at that energy
/// water, bone and iodine together attenuate exactly as in the scan.
std::array<Opacity, kMaterials.size()> material_contents();

/// Splits the contrast agent off a scan: within the vessels (mask voxels above 0), all HU above kBloodHu.
/// `scan` keeps the blood; the result is the enhancement in HU, 0 outside the vessels. The two add up to the
/// original scan, and so do their interpolated values between voxels, across the mask's border too; that is
/// why voxels are split and not sorted into two scans.
///
/// Throws InputError when the mask does not lie on the scan's grid.
Volume take_contrast(Volume& scan, Volume mask);

/// Throws InputError, with `name` in front and naming both grids, unless they are the same to within a
/// hundredth of a voxel.
void check_mask_grid(const VolumeGeometry& mask, const VolumeGeometry& scan, const std::string& name);

}  // namespace xraycast
