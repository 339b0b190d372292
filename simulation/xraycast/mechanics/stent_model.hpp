#pragma once

#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A stent, as a mesh on a cylinder: rings of straight struts in zigzag, and straight links along the axis
/// between them. Opened, struts keep their length and fold open at their crowns, so that a ring becomes lower
/// and the stent shorter (foreshortening); links stay as they are. A balloon opens it or, where it has forces
/// of its own, it opens itself as its sheath is drawn back.
struct StentModel {
  /// A line of the chart of a self-expanding stent: with how much it presses on a vessel of that diameter as
  /// it opens, radially, summed up around it (chronic outward force).
  struct Force {
    double diameter_mm = 0, outward_N_mm = 0;  ///< per length of the stent
  };
  double diameter_mm = 0, length_mm = 0;  ///< nominal, opened
  int rings = 0;
  int crowns = 0;       ///< of a ring, at either of its edges: it has twice as many struts
  int links = 0;        ///< from a ring to the next
  double link_mm = 0;   ///< length of each
  double strut_mm = 0;  ///< thickness and width of struts and links
  // Of a self-expanding one.
  double from_tip_mm = 0;        ///< of its instrument to its far end, in the sheath
  std::vector<Force> outward{};  ///< by ascending diameters, to 0 at diameter_mm; none: a balloon opens it

  bool expands_itself() const { return !outward.empty(); }
  /// Linear between the lines of the chart, and below the first one as there.
  double outward_N_mm(double diameter_mm) const;

  /// At a diameter, that of the middle of the struts.
  double ring_height_mm(double diameter_mm) const;
  double length_at_mm(double diameter_mm) const;
  /// Of so many rings, each with its own radius.
  double length_of_mm(std::span<const double> radii_mm) const;
  /// At which struts would lie around the vessel.
  double widest_mm() const;

 private:
  double strut_length_mm() const;
  double across_mm(double diameter_mm) const;  ///< of a strut, around the cylinder
};

/// Throws InputError, with `origin` in front, for a number that is not finite or not above zero, fewer than 3
/// crowns or than 1 ring, more links than crowns, rings that have no height at the nominal diameter, a stent
/// that cannot be opened to `largest_mm`, and a chart whose diameters do not ascend, whose forces grow, or
/// that does not end with 0 at the nominal diameter.
void check(const StentModel& stent, double largest_mm, const std::string& origin);

}  // namespace xraycast
