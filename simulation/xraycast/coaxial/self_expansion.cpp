#include "xraycast/coaxial/self_expansion.hpp"

#include <numbers>

namespace xraycast {

double expanded_radius_mm(const StentModel& stent, double vessel_mm) {
  double low_mm = vessel_mm, high_mm = 0.5 * stent.diameter_mm;
  if (low_mm >= high_mm) return high_mm;
  // What is left of the force falls with the radius: halved until doubles have no number in between.
  constexpr int kHalvings = 60;
  for (int i = 0; i < kHalvings; ++i) {
    const double radius_mm = 0.5 * (low_mm + high_mm);
    const double wall_N_mm =
        2 * std::numbers::pi * radius_mm * kWallModulus_N_mm2 * (radius_mm / vessel_mm - 1);
    (stent.outward_N_mm(2 * radius_mm) > wall_N_mm ? low_mm : high_mm) = radius_mm;
  }
  return low_mm;
}

}  // namespace xraycast
