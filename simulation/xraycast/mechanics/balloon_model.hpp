#pragma once

#include <string>
#include <vector>

namespace xraycast {

/// A balloon on a catheter, as its package describes it. Folded, it is as thick as the catheter.
struct BalloonModel {
  /// A line of the compliance chart.
  struct Size {
    double bar = 0, diameter_mm = 0;
  };
  double diameter_mm = 0;  ///< nominal: at nominal_bar
  double length_mm = 0;    ///< of its cylinder
  double from_tip_mm = 0;  ///< of the catheter to that cylinder
  double nominal_bar = 0;
  double rated_burst_bar = 0;
  std::vector<Size> chart;  ///< by ascending pressures, from above 0 to rated_burst_bar

  double middle_from_tip_mm() const { return from_tip_mm + 0.5 * length_mm; }

  /// At a pressure, by the chart: linear between its lines, and from `folded_mm` at 0 to its first one.
  double diameter_at_mm(double bar, double folded_mm) const;
};

/// Throws InputError, with `origin` in front, for a number that is not finite or not above zero (the distance
/// from the tip may be zero), a nominal pressure above the rated burst pressure, a chart whose pressures do
/// not ascend, whose diameters fall, whose first diameter is below `folded_mm`, that ends before the rated
/// burst pressure, or that has another diameter than the nominal one by more than 0.05 mm.
void check(const BalloonModel& balloon, double folded_mm, const std::string& origin);

}  // namespace xraycast
