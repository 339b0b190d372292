#pragma once

#include <Eigen/Core>
#include <cmath>

namespace xraycast {

/// Coulomb friction in the plane of contact, regularised by a spring: it sticks, anchored where it stuck, and
/// slips when the spring's force reaches a limit (return mapping: Simo and Hughes, Computational
/// Inelasticity, 1998, chapter 1). With a fixed limit it is a potential of the displacement from the anchor,
/// quadratic while it sticks and conical while it slips.
struct Friction {
  double spring_mN_mm = 0, limit_mN = 0;

  bool is_active() const { return limit_mN > 0; }

  double energy_uJ(const Eigen::Vector2d& displacement_mm) const {
    const double squared_mm2 = squared(displacement_mm);
    return slips(squared_mm2) ? limit_mN * std::sqrt(squared_mm2) - 0.5 * limit_mN * limit_mN / spring_mN_mm
                              : 0.5 * spring_mN_mm * squared_mm2;
  }

  /// The potential's gradient and Hessian.
  struct Derivatives {
    Eigen::Vector2d gradient_mN;
    Eigen::Matrix2d hessian_mN_mm;
  };
  Derivatives derivatives(const Eigen::Vector2d& displacement_mm) const {
    const double x = displacement_mm[0], y = displacement_mm[1], squared_mm2 = squared(displacement_mm);
    Derivatives by;
    if (!slips(squared_mm2)) {
      by.gradient_mN = {spring_mN_mm * x, spring_mN_mm * y};
      by.hessian_mN_mm << spring_mN_mm, 0, 0, spring_mN_mm;
      return by;
    }
    const double length = std::sqrt(squared_mm2);
    const double along = x / length, across = y / length, turning = limit_mN / length;
    by.gradient_mN = {limit_mN * along, limit_mN * across};
    by.hessian_mN_mm << turning * across * across, -turning * along * across, -turning * along * across,
        turning * along * along;
    return by;
  }

  /// The state at the end of a step.
  struct Returned {
    bool slips = false;
    Eigen::Vector2d force_mN;         ///< on the moving surface
    Eigen::Vector2d displacement_mm;  ///< of the spring, from the anchor that it has dragged along
  };
  /// `kinetic_share`: the fraction of the limit that remains while slipping.
  Returned return_map(const Eigen::Vector2d& displacement_mm, double kinetic_share) const {
    const double x = displacement_mm[0], y = displacement_mm[1], squared_mm2 = squared(displacement_mm);
    Returned returned;
    returned.slips = slips(squared_mm2);
    const double length = std::sqrt(squared_mm2);
    const double force = returned.slips ? limit_mN / length : spring_mN_mm;
    const double kept = returned.slips ? kinetic_share * limit_mN / (spring_mN_mm * length) : 1;
    returned.force_mN = {-force * x, -force * y};
    returned.displacement_mm = {kept * x, kept * y};
    return returned;
  }

 private:
  bool slips(double squared_mm2) const {
    return spring_mN_mm * spring_mN_mm * squared_mm2 > limit_mN * limit_mN;
  }
  // Number by number, here and above: vectors that were just put together of two numbers are slow to load.
  static double squared(const Eigen::Vector2d& v) { return v[0] * v[0] + v[1] * v[1]; }
};

}  // namespace xraycast
