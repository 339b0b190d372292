#pragma once

#include <Eigen/Core>

namespace xraycast {

/// Coulomb friction in the plane of contact, regularised by a spring: it sticks, anchored where it stuck, and
/// slips when the spring's force reaches a limit (return mapping: Simo and Hughes, Computational
/// Inelasticity, 1998, chapter 1). With a fixed limit it is a potential of the displacement from the anchor,
/// quadratic while it sticks and conical while it slips.
struct Friction {
  double spring_mN_mm = 0, limit_mN = 0;

  bool is_active() const { return limit_mN > 0; }

  double energy_uJ(const Eigen::Vector2d& displacement_mm) const {
    const double length = displacement_mm.norm();
    return slips(length) ? limit_mN * length - 0.5 * limit_mN * limit_mN / spring_mN_mm
                         : 0.5 * spring_mN_mm * length * length;
  }

  /// The potential's gradient and Hessian.
  struct Derivatives {
    Eigen::Vector2d gradient_mN;
    Eigen::Matrix2d hessian_mN_mm;
  };
  Derivatives derivatives(const Eigen::Vector2d& displacement_mm) const {
    const double length = displacement_mm.norm();
    if (!slips(length)) return {spring_mN_mm * displacement_mm, spring_mN_mm * Eigen::Matrix2d::Identity()};
    const Eigen::Vector2d direction = displacement_mm / length;
    return {limit_mN * direction,
            limit_mN / length * (Eigen::Matrix2d::Identity() - direction * direction.transpose())};
  }

  /// The state at the end of a step.
  struct Returned {
    bool slips = false;
    Eigen::Vector2d force_mN;         ///< on the moving surface
    Eigen::Vector2d displacement_mm;  ///< of the spring, from the anchor that it has dragged along
  };
  /// `kinetic_share`: the fraction of the limit that remains while slipping.
  Returned return_map(const Eigen::Vector2d& displacement_mm, double kinetic_share) const {
    const double length = displacement_mm.norm();
    Returned returned{slips(length), -derivatives(displacement_mm).gradient_mN, displacement_mm};
    if (returned.slips) returned.displacement_mm *= kinetic_share * limit_mN / (spring_mN_mm * length);
    return returned;
  }

 private:
  bool slips(double length_mm) const { return spring_mN_mm * length_mm > limit_mN; }
};

}  // namespace xraycast
