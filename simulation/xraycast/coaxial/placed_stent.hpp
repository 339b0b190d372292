#pragma once

#include "xraycast/catheter/yielding_walls.hpp"
#include "xraycast/mechanics/stent_model.hpp"

#include <cstddef>
#include <vector>

namespace xraycast {

/// A stent that was left in a vessel, along its centreline, and holds its wall open. Each of its rings is as
/// wide as what opened it there left it.
struct PlacedStent {
  StentModel model;
  int branch = 0;
  double middle_mm = 0;  ///< of the rings that are free, from the branch's first point
  /// Of the middle of the struts of each ring that is free, along the branch.
  std::vector<double> radii_mm{};
  /// Of the vessel at each of them, without the stent; none of a stent that a balloon opened.
  std::vector<double> vessel_mm{};
  std::size_t treatment = 0;  ///< that left it, of Treatments::list()

  double length_mm() const;
  double from_mm() const { return middle_mm - 0.5 * length_mm(); }
  double to_mm() const { return middle_mm + 0.5 * length_mm(); }
  /// Of a ring's edge that is nearer to the branch's first point.
  double ring_from_mm(std::size_t ring) const;
  double ring_middle_mm(std::size_t ring) const;
  /// Of the struts at a place along the branch; between two rings linear, and beyond the ends as there.
  double radius_at_mm(double arc_mm) const;
  double mean_radius_mm() const;

  /// By which it holds the wall open: a ring as far as to the middle of its links.
  std::vector<YieldingWalls::Opening> openings() const;
};

/// How far a stent's struts are from the wall.
struct Malapposition {
  static constexpr double kNoticed_mm = 0.2;
  double largest_mm = 0;
  double share = 0;  ///< of the stent's length, more than kNoticed_mm away
};
Malapposition malapposition(const PlacedStent& stent, const LumenDistanceField& walls);

}  // namespace xraycast
