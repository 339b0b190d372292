#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <cstddef>
#include <vector>

namespace xraycast {

/// What a stretch of vessel sets against the blood, as a FlowNode's element: mmHg, ml and s.
struct FlowLoss {
  double resistance = 0, inertance = 0, quadratic_loss = 0;
  int blocked = 0;  ///< places that an instrument fills
};

/// Radii of a branch's points without its narrow places: none is below both the widest one before it and the
/// widest one behind.
std::vector<double> healthy_radii_mm(const VesselBranch& branch);

/// Resistance, inertance and quadratic loss of a branch, from its first point to any place.
///
/// Resistance is Poiseuille's, 8 mu L / (pi r^4), inertance rho L / (pi r^2), integrated over radii that are
/// linear between points. Where the branch is narrower than before and behind, a stenosis, its throat has the
/// losses of Young and Tsai (J Biomech 6:395 and 547, 1973): behind the throat the blood's kinetic energy is
/// lost, 1.52 rho / 2 (1 / A_throat - 1 / A)^2 q^2; and it is as long for the viscous losses as 0.83 of its
/// length and 1.64 of its width (Seeley and Young, J Biomech 9:439, 1976). Both fade out from a narrowing by
/// half of the area to one by a quarter, where no flow separates: walls are uneven, and so are segmentations.
///
/// An instrument that lies in the vessel leaves an annulus, whose resistance is that of two concentric
/// cylinders; where it is as wide as the vessel it blocks that.
class VesselImpedance {
 public:
  /// Of radii other than the branch's, if they are given: one a point.
  explicit VesselImpedance(const VesselBranch& branch, const std::vector<double>& radii_mm = {});

  FlowLoss up_to(double arc_length_mm) const;
  FlowLoss whole() const { return up_to_.back(); }

  /// An instrument in it, between two places.
  void occupy(double from_mm, double to_mm, double radius_mm);
  /// Takes all of them out.
  void empty();

 private:
  struct Throat {
    std::size_t point = 0;
    double quadratic_loss = 0, added_resistance = 0;
  };
  /// An instrument in a segment, and in how much of its length.
  struct Occupied {
    double radius_mm = 0, share = 0;
  };
  void find_stenoses();
  void add_up();

  std::vector<double> arc_mm_, radius_mm_;
  std::vector<Occupied> occupied_;  ///< each segment
  std::vector<Throat> throats_;
  std::vector<FlowLoss> up_to_;  ///< each point
};

}  // namespace xraycast
