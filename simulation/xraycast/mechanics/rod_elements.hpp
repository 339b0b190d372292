#pragma once

#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/rod_frames.hpp"

#include <array>

namespace xraycast {

// What a rod's nodes bring into the potential of a step: of one (`Real` is double) or of four (Lanes). `Node`
// is Rod's own.

/// Of bending towards m1 and m2, and of twisting.
template <typename Real>
using Moments = std::array<Real, 3>;

/// The bending and the twisting at a node, as it is and as the step began.
template <typename Real>
struct Springs {
  Real bending_uJ, torsional_uJ, rest_kappa1, rest_kappa2, start_kappa1, start_kappa2, start_twist_rad;

  template <typename Node>
  [[gnu::always_inline]] static Springs of(const LaneSources<Real, Node>& from) {
    return {gathered<Real, Node>(from, [](const Node& n) { return n.bending_stiffness_uJ; }),
            gathered<Real, Node>(from, [](const Node& n) { return n.torsional_stiffness_uJ; }),
            gathered<Real, Node>(from, [](const Node& n) { return n.rest_kappa[0]; }),
            gathered<Real, Node>(from, [](const Node& n) { return n.rest_kappa[1]; }),
            gathered<Real, Node>(from, [](const Node& n) { return n.start_kappa[0]; }),
            gathered<Real, Node>(from, [](const Node& n) { return n.start_kappa[1]; }),
            gathered<Real, Node>(from, [](const Node& n) { return n.start_twist_rad; })};
  }

  /// Elastic, and with `damping`, the retardation time over the step's, dissipated.
  [[gnu::always_inline]] Real energy_uJ(const NodeStrains<Real>& strain, double damping) const {
    const Real b1 = strain.kappa1 - rest_kappa1, b2 = strain.kappa2 - rest_kappa2,
               c1 = strain.kappa1 - start_kappa1, c2 = strain.kappa2 - start_kappa2,
               t = strain.twist_rad - start_twist_rad;
    return 0.5 * (bending_uJ * (b1 * b1 + b2 * b2 + damping * (c1 * c1 + c2 * c2)) +
                  torsional_uJ * (strain.twist_rad * strain.twist_rad + damping * (t * t)));
  }

  /// In mN mm.
  [[gnu::always_inline]] Moments<Real> moments(const NodeStrains<Real>& strain, double damping) const {
    return {bending_uJ * (strain.kappa1 - rest_kappa1 + damping * (strain.kappa1 - start_kappa1)),
            bending_uJ * (strain.kappa2 - rest_kappa2 + damping * (strain.kappa2 - start_kappa2)),
            torsional_uJ * (strain.twist_rad + damping * (strain.twist_rad - start_twist_rad))};
  }
};

/// A node's motion in a step: its coefficients over the step's duration, and the motion itself.
template <typename Real>
struct NodeMotion {
  Real inertia, drag, quadratic;                          ///< in mN/mm, and mN/mm^2
  Triple<Real> weight_mN;                                 ///< and loads
  Triple<Real> moved_mm, lag_mm, transverse_mm, tangent;  ///< lag: behind where inertia alone leads
  Real transverse_length_mm;

  template <typename Node>
  [[gnu::always_inline]] NodeMotion(const LaneSources<Real, Node>& from, const Triple<Real>& position_mm,
                                    const Eigen::Vector3d& gravity_mm_s2, double dt_s) {
    const Real mass_kg = gathered<Real, Node>(from, [](const Node& n) { return n.mass_kg; });
    inertia = (1 / (dt_s * dt_s)) * mass_kg;
    drag = (1 / dt_s) * gathered<Real, Node>(from, [](const Node& n) { return n.linear_drag_kg_s; });
    quadratic = (1 / (dt_s * dt_s)) *
                gathered<Real, Node>(from, [](const Node& n) { return n.quadratic_drag_kg_mm; });
    tangent = gathered_triple<Real, Node>(
        from, [](const Node& n) -> auto& { return n.start_tangent; });
    const Triple<Real> velocity_mm_s = gathered_triple<Real, Node>(
        from, [](const Node& n) -> auto& { return n.velocity_mm_s; });
    const Triple<Real> gravity{all<Real>(gravity_mm_s2[0]), all<Real>(gravity_mm_s2[1]),
                               all<Real>(gravity_mm_s2[2])};
    weight_mN = gathered_triple<Real, Node>(
                    from, [](const Node& n) -> auto& { return n.load_mN; }) +
                mass_kg * gravity;
    moved_mm = position_mm - gathered_triple<Real, Node>(
                                 from, [](const Node& n) -> auto& { return n.start_mm; });
    lag_mm = moved_mm - all<Real>(dt_s) * velocity_mm_s;
    transverse_mm = moved_mm - dot(moved_mm, tangent) * tangent;
    transverse_length_mm = square_root(dot(transverse_mm, transverse_mm));
  }

  [[gnu::always_inline]] Real energy_uJ() const {
    return 0.5 * inertia * dot(lag_mm, lag_mm) + 0.5 * drag * dot(moved_mm, moved_mm) +
           (1.0 / 3) * quadratic * dot(transverse_mm, transverse_mm) * transverse_length_mm -
           dot(weight_mN, moved_mm);
  }
  [[gnu::always_inline]] Triple<Real> gradient_mN() const {
    return inertia * lag_mm + drag * moved_mm + (quadratic * transverse_length_mm) * transverse_mm -
           weight_mN;
  }
};

}  // namespace xraycast
