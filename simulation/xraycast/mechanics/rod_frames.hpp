#pragma once

#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {

// How a rod's frames follow its edges, and the strain between two of them; of one (`Real` is double) or of
// four (Lanes).

template <typename Real>
struct EdgeFrames {
  Triple<Real> tangent, m1, m2;
  Real length_mm;

  [[gnu::always_inline]] static EdgeFrames of(const LaneSources<Real, RodState::Frame>& from) {
    using Frame = RodState::Frame;
    return {gathered_triple<Real, Frame>(
                from, [](const Frame& f) -> auto& { return f.tangent; }),
            gathered_triple<Real, Frame>(
                from, [](const Frame& f) -> auto& { return f.m1; }),
            gathered_triple<Real, Frame>(
                from, [](const Frame& f) -> auto& { return f.m2; }),
            gathered<Real, Frame>(from, [](const Frame& f) { return f.length_mm; })};
  }
  [[gnu::always_inline]] RodState::Frame lane_frame(std::size_t k) const {
    return {lane_vector<Eigen::Vector3d>(tangent, k), lane_vector<Eigen::Vector3d>(m1, k),
            lane_vector<Eigen::Vector3d>(m2, k), lane(length_mm, k)};
  }
};

template <typename Real>
struct NodeStrains {
  Triple<Real> curvature_binormal;
  Real kappa1, kappa2, twist_rad;

  [[gnu::always_inline]] static NodeStrains of(const LaneSources<Real, RodState::Strain>& from) {
    using Strain = RodState::Strain;
    return {gathered_triple<Real, Strain>(
                from, [](const Strain& s) -> auto& { return s.curvature_binormal; }),
            gathered<Real, Strain>(from, [](const Strain& s) { return s.kappa[0]; }),
            gathered<Real, Strain>(from, [](const Strain& s) { return s.kappa[1]; }),
            gathered<Real, Strain>(from, [](const Strain& s) { return s.twist_rad; })};
  }
  [[gnu::always_inline]] RodState::Strain lane_strain(std::size_t k) const {
    return {lane_vector<Eigen::Vector3d>(curvature_binormal, k),
            {lane(kappa1, k), lane(kappa2, k)},
            lane(twist_rad, k)};
  }
};

/// What precedes four edges, each by one: the last of the four before, and the first three.
[[gnu::always_inline]] inline Lanes preceding(const Lanes& before, const Lanes& here) {
  return __builtin_shufflevector(before, here, 3, 4, 5, 6);
}
[[gnu::always_inline]] inline Triple<Lanes> preceding(const Triple<Lanes>& before,
                                                      const Triple<Lanes>& here) {
  return {preceding(before.x, here.x), preceding(before.y, here.y), preceding(before.z, here.z)};
}
[[gnu::always_inline]] inline EdgeFrames<Lanes> preceding(const EdgeFrames<Lanes>& before,
                                                          const EdgeFrames<Lanes>& here) {
  return {preceding(before.tangent, here.tangent), preceding(before.m1, here.m1),
          preceding(before.m2, here.m2), preceding(before.length_mm, here.length_mm)};
}

// ---- angles ---------------------------------------------------------------------------------------------

// Of one by the standard library, of four by series where all are small. Their last digits differ, and those
// of a lane depend on whether its neighbours are small.

template <typename Real>
struct Turn {
  Real cosine, sine;
};

[[gnu::always_inline]] inline Turn<double> turn_by(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

/// By Taylor's series, exact to rounding, where all angles are small, as they are in a step.
[[gnu::always_inline]] inline Turn<Lanes> turn_by(Lanes angle_rad) {
  constexpr double kSmall_rad = 0.5;  // its 15th power over 15! is a quarter of the last digit
  if (any(magnitude(angle_rad) > kSmall_rad))
    return {
        Lanes{std::cos(angle_rad[0]), std::cos(angle_rad[1]), std::cos(angle_rad[2]), std::cos(angle_rad[3])},
        Lanes{std::sin(angle_rad[0]), std::sin(angle_rad[1]), std::sin(angle_rad[2]),
              std::sin(angle_rad[3])}};
  const Lanes x = angle_rad * angle_rad;
  const auto next = [x](double factor, Lanes rest) __attribute__((always_inline)) {
    return 1.0 - x * (1 / factor) * rest;
  };
  const Lanes one = all<Lanes>(1);
  return {next(1 * 2, next(3 * 4, next(5 * 6, next(7 * 8, next(9 * 10, next(11 * 12, next(13 * 14, one))))))),
          angle_rad * next(2 * 3, next(4 * 5, next(6 * 7, next(8 * 9, next(10 * 11, next(12 * 13, one))))))};
}

/// Of a sine and a cosine.
[[gnu::always_inline]] inline double angle_of(double sine, double cosine) { return std::atan2(sine, cosine); }

/// By the series of twice the inverse tangent of the half angle's, exact to rounding, where all are small.
[[gnu::always_inline]] inline Lanes angle_of(Lanes sine, Lanes cosine) {
  constexpr double kSmall = 0.125;  // its 18th power over 19 is below a tenth of the last digit
  const Lanes tangent = sine / (1.0 + cosine);
  if (any(magnitude(tangent) > kSmall) || any(cosine < 0.0))
    return Lanes{std::atan2(sine[0], cosine[0]), std::atan2(sine[1], cosine[1]),
                 std::atan2(sine[2], cosine[2]), std::atan2(sine[3], cosine[3])};
  const Lanes x = tangent * tangent, x2 = x * x, x4 = x2 * x2;
  // In pairs of powers, which do not wait for each other.
  const Lanes low = (1.0 - x * (1.0 / 3)) + x2 * (1.0 / 5 - x * (1.0 / 7)),
              high = (1.0 / 9 - x * (1.0 / 11)) + x2 * (1.0 / 13 - x * (1.0 / 15)) + x4 * (1.0 / 17);
  return 2.0 * tangent * (low + x4 * high);
}

/// The nearest whole number.
[[gnu::always_inline]] inline double whole(double value) { return std::round(value); }
[[gnu::always_inline]] inline Lanes whole(Lanes value) {
  constexpr double kNoFraction = 6755399441055744;  // 1.5 * 2^52: beside it numbers are whole
  return (value + kNoFraction) - kNoFraction;
}

// ---- frames ---------------------------------------------------------------------------------------------

/// A vector normal to a unit tangent `from`, rotated along the great circle to `to`.
template <typename Real>
[[gnu::always_inline]] inline Triple<Real> parallel_transported(const Triple<Real>& v,
                                                                const Triple<Real>& from,
                                                                const Triple<Real>& to) {
  const Real scale = dot(v, to) / (1.0 + dot(from, to));
  return v - scale * (from + to);
}

/// About its tangent.
template <typename Real>
[[gnu::always_inline]] inline EdgeFrames<Real> rotated(const EdgeFrames<Real>& frame, Real angle_rad) {
  const Turn<Real> turn = turn_by(angle_rad);
  return {frame.tangent, turn.cosine * frame.m1 + turn.sine * frame.m2,
          turn.cosine * frame.m2 - turn.sine * frame.m1, frame.length_mm};
}

/// To an edge, without twist.
template <typename Real>
[[gnu::always_inline]] inline EdgeFrames<Real> transported(const Triple<Real>& tangent,
                                                           const Triple<Real>& m1,
                                                           const Triple<Real>& edge_mm) {
  EdgeFrames<Real> to;
  to.length_mm = square_root(dot(edge_mm, edge_mm));
  to.tangent = edge_mm / to.length_mm;
  const Triple<Real> moved = parallel_transported(m1, tangent, to.tangent);
  // Rounding would add up over the steps.
  const Triple<Real> normal = moved - dot(moved, to.tangent) * to.tangent;
  to.m1 = normal / square_root(dot(normal, normal));
  to.m2 = cross(to.tangent, to.m1);
  return to;
}

template <typename Real>
[[gnu::always_inline]] inline NodeStrains<Real> strain_between(const EdgeFrames<Real>& e,
                                                               const EdgeFrames<Real>& f,
                                                               Real expected_twist_rad) {
  const Real chi = 1.0 + dot(e.tangent, f.tangent);
  const Real scale = 2.0 / choose(chi > 1e-9, chi, all<Real>(1e-9));
  NodeStrains<Real> strain;
  strain.curvature_binormal = scale * cross(e.tangent, f.tangent);
  strain.kappa1 = 0.5 * dot(strain.curvature_binormal, e.m2 + f.m2);
  strain.kappa2 = -0.5 * dot(strain.curvature_binormal, e.m1 + f.m1);
  const Triple<Real> untwisted = e.m1 - (dot(e.m1, f.tangent) / chi) * (e.tangent + f.tangent);
  const Real angle = angle_of(-dot(untwisted, f.m2), dot(untwisted, f.m1));
  constexpr double kTurn = 2 * std::numbers::pi;
  strain.twist_rad = angle + kTurn * whole((expected_twist_rad - angle) * (1 / kTurn));
  return strain;
}

}  // namespace xraycast
