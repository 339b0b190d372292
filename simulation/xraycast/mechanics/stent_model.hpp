#pragma once

#include <string>

namespace xraycast {

/// A stent on a balloon, as a mesh on a cylinder: rings of straight struts in zigzag, and straight links
/// along the axis between them. Opened, struts keep their length and fold open at their crowns, so that a
/// ring becomes lower and the stent shorter (foreshortening); links stay as they are.
struct StentModel {
  double diameter_mm = 0, length_mm = 0;  ///< nominal, opened
  int rings = 0;
  int crowns = 0;       ///< of a ring, at either of its edges: it has twice as many struts
  int links = 0;        ///< from a ring to the next
  double link_mm = 0;   ///< length of each
  double strut_mm = 0;  ///< thickness and width of struts and links

  /// At a diameter, that of the middle of the struts.
  double ring_height_mm(double diameter_mm) const;
  double length_at_mm(double diameter_mm) const;
  /// At which struts would lie around the vessel.
  double widest_mm() const;

 private:
  double strut_length_mm() const;
  double across_mm(double diameter_mm) const;  ///< of a strut, around the cylinder
};

/// Throws InputError, with `origin` in front, for a number that is not finite or not above zero, fewer than 3
/// crowns or than 1 ring, more links than crowns, rings that have no height at the nominal diameter, or a
/// stent that cannot be opened to `largest_mm`.
void check(const StentModel& stent, double largest_mm, const std::string& origin);

}  // namespace xraycast
