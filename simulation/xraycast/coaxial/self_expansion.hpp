#pragma once

#include "xraycast/mechanics/stent_model.hpp"

namespace xraycast {

/// The pressure by which an artery is stretched, over its strain: the pressure-strain modulus of femoral
/// arteries of men above 60 (Mozersky et al., Circulation 46:948, 1972: 6.3e6 dyn/cm2). A lesion is stiffer.
inline constexpr double kWallModulus_N_mm2 = 0.63;

/// Where a self-expanding stent comes to rest in a vessel that has a radius without it, under the blood's
/// pressure: its force outwards is the wall's inwards, outward(2 r) = 2 pi r kWallModulus (r / vessel - 1).
/// In a vessel that is wider than the stent it is as wide as free.
double expanded_radius_mm(const StentModel& stent, double vessel_mm);

}  // namespace xraycast
