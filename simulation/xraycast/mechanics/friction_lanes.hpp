#pragma once

#include "xraycast/mechanics/lanes.hpp"

namespace xraycast {

/// Friction (see Friction) of four contacts at once, in the plane of two displacements from their anchors.
/// Those whose limit is zero have none.
struct FrictionLanes {
  Lanes spring_mN_mm{}, limit_mN{}, x_mm{}, y_mm{};
  Lanes length_mm = square_root(x_mm * x_mm + y_mm * y_mm);
  LaneMask slips = spring_mN_mm * length_mm > limit_mN;

  [[gnu::always_inline]] Lanes energy_uJ() const {
    const Lanes energy = choose(slips, limit_mN * (length_mm - 0.5 * limit_mN / spring_mN_mm),
                                0.5 * spring_mN_mm * (length_mm * length_mm));
    return choose(limit_mN > 0.0, energy, Lanes{});
  }

  /// The potential's gradient and Hessian.
  struct Derivatives {
    Lanes x_mN, y_mN, xx_mN_mm, xy_mN_mm, yy_mN_mm;
  };
  [[gnu::always_inline]] Derivatives derivatives() const {
    const Lanes along = x_mm / length_mm, across = y_mm / length_mm, turning = limit_mN / length_mm;
    return {choose(slips, limit_mN * along, spring_mN_mm * x_mm),
            choose(slips, limit_mN * across, spring_mN_mm * y_mm),
            choose(slips, turning * across * across, spring_mN_mm),
            choose(slips, -turning * along * across, Lanes{}),
            choose(slips, turning * along * along, spring_mN_mm)};
  }
};

}  // namespace xraycast
