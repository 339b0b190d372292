#include "xraycast/catheter/lumen_profile.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// The first of the two stations that a place lies between.
int station_before(const LumenDistanceField& field, int branch, double arc_length_mm) {
  const double first_mm = field.station_arc_mm(branch, 0);
  const double step_mm = field.station_arc_mm(branch, 1) - first_mm;
  const double at = std::floor((arc_length_mm - first_mm) / step_mm);
  return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(field.station_count(branch) - 2)));
}

}  // namespace

double radius_mm(const LumenDistanceField& field, int branch, double arc_length_mm) {
  const int k = station_before(field, branch, arc_length_mm);
  const double from_mm = field.station_arc_mm(branch, k), to_mm = field.station_arc_mm(branch, k + 1);
  return std::lerp(field.station_radius_mm(branch, k), field.station_radius_mm(branch, k + 1),
                   std::clamp((arc_length_mm - from_mm) / (to_mm - from_mm), 0.0, 1.0));
}

double narrowest_at_mm(const LumenDistanceField& field, int branch, double from_mm, double to_mm) {
  double at_mm = from_mm, least_mm = radius_mm(field, branch, from_mm);
  const auto look_at = [&](double arc_mm, double of_vessel_mm) {
    if (of_vessel_mm >= least_mm) return;
    least_mm = of_vessel_mm;
    at_mm = arc_mm;
  };
  for (int k = station_before(field, branch, from_mm) + 1; k < field.station_count(branch); ++k) {
    const double arc_mm = field.station_arc_mm(branch, k);
    if (arc_mm >= to_mm) break;
    if (arc_mm > from_mm) look_at(arc_mm, field.station_radius_mm(branch, k));
  }
  look_at(to_mm, radius_mm(field, branch, to_mm));
  return at_mm;
}

double least_radius_mm(const LumenDistanceField& field, int branch, double from_mm, double to_mm) {
  return radius_mm(field, branch, narrowest_at_mm(field, branch, from_mm, to_mm));
}

}  // namespace xraycast
