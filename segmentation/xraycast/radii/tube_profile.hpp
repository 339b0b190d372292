#pragma once

#include <vector>

namespace xraycast {

/// What a scan shows of a round lumen across its axis: a disc of a radius, blurred by a Gaussian. It is one
/// minus Marcum's function Q1(distance / blur, radius / blur), tabulated over the distance from the axis. All
/// lengths are in one unit.
class TubeProfile {
 public:
  /// Both above zero.
  TubeProfile(double radius, double blur);

  struct Value {
    double share;                   ///< of the lumen's contrast, from 0 to 1
    double by_radius, by_distance;  ///< its derivatives
  };
  Value at(double distance) const;

 private:
  double step_;
  std::vector<Value> values_;  ///< of distances `step_` apart, from the axis on
};

}  // namespace xraycast
