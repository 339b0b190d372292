#pragma once

#include "xraycast/mechanics/balloon_model.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A radiopaque ring around an instrument, such as the band at a catheter's tip, or the coil around a wire's.
/// It lies flush: its outside is the instrument's.
struct MarkerModel {
  std::string material = "platinum";  ///< one of marker_materials()
  double from_tip_mm = 0;             ///< of the instrument to the marker
  double length_mm = 1;
  double thickness_mm = 0.05;  ///< of its wall; of a coil, that of a tube of as much metal

  double middle_from_tip_mm() const { return from_tip_mm + 0.5 * length_mm; }
  double end_from_tip_mm() const { return from_tip_mm + length_mm; }
  bool operator==(const MarkerModel&) const = default;
};

/// `platinum`, `platinum-iridium`, `gold`, `tantalum` and `tungsten`: solid_named knows them all.
const std::vector<std::string>& marker_materials();

/// What an instrument has whose file says nothing of markers: a guide wire, which has no lumen, a platinum
/// coil over its last 30 mm that fills a quarter of its cross-section; a balloon catheter a platinum band of
/// 1 mm about either end of its balloon's cylinder; others none.
std::vector<MarkerModel> usual_markers(double radius_mm, double inner_radius_mm, double length_mm,
                                       const std::optional<BalloonModel>& balloon = std::nullopt);

/// Throws InputError, with `origin` in front, for another material, a number that is not finite or out of its
/// range, a wall thicker than the instrument's, and a marker that ends beyond `length_mm`; also for more than
/// 50 of them.
void check(const std::vector<MarkerModel>& markers, double radius_mm, double inner_radius_mm,
           double length_mm, const std::string& origin);

}  // namespace xraycast
