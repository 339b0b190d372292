#include "xraycast/radii/tube_profile.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace xraycast {
namespace {

/// The sum of c[i] x^i.
template <std::size_t N>
double polynomial(const double (&c)[N], double x) {
  double sum = 0;
  for (std::size_t i = N; i-- > 0;) sum = sum * x + c[i];
  return sum;
}

/// exp(-x) I0(x) and exp(-x) I1(x), the modified Bessel functions, for x of 0 and more: to 2e-7 by the
/// polynomials 9.8.1 to 9.8.4 of Abramowitz and Stegun, Handbook of Mathematical Functions.
struct ScaledBessel {
  double i0, i1;
};

ScaledBessel scaled_bessel(double x) {
  constexpr double kBetween = 3.75;
  if (x < kBetween) {
    constexpr double kI0[]{1, 3.5156229, 3.0899424, 1.2067492, 0.2659732, 0.0360768, 0.0045813};
    constexpr double kI1[]{0.5, 0.87890594, 0.51498869, 0.15084934, 0.02658733, 0.00301532, 0.00032411};
    const double t2 = (x / kBetween) * (x / kBetween), scale = std::exp(-x);
    return {scale * polynomial(kI0, t2), scale * x * polynomial(kI1, t2)};
  }
  constexpr double kI0[]{0.39894228,  0.01328592, 0.00225319,  -0.00157565, 0.00916281,
                         -0.02057706, 0.02635537, -0.01647633, 0.00392377};
  constexpr double kI1[]{0.39894228, -0.03988024, -0.00362018, 0.00163801, -0.01031555,
                         0.02282967, -0.02895312, 0.01787654,  -0.00420059};
  const double inverse = kBetween / x, root = 1 / std::sqrt(x);
  return {root * polynomial(kI0, inverse), root * polynomial(kI1, inverse)};
}

}  // namespace

TubeProfile::TubeProfile(double radius, double blur) : step_(0.0625 * blur) {
  constexpr double kBeyond = 5;  // blurs outside of the wall, where a millionth is left
  const double variance = blur * blur;
  const auto count = static_cast<std::size_t>((radius + kBeyond * blur) / step_) + 2;
  values_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double distance = static_cast<double>(i) * step_, off = radius - distance;
    const auto [i0, i1] = scaled_bessel(radius * distance / variance);
    const double density = radius / variance * std::exp(-0.5 * off * off / variance);
    values_[i] = {0, density * i0, -density * i1};
  }
  // Shares by the integral of their slope, from what is known on the axis: Simpson's rule with the slope
  // halfway from the curvature that both ends' differences tell.
  values_[0].share = -std::expm1(-0.5 * radius * radius / variance);
  for (std::size_t i = 1; i < count; ++i) {
    const double before = values_[i - 1].by_distance, here = values_[i].by_distance,
                 earlier = i > 1 ? values_[i - 2].by_distance : -here,  // odd about the axis
        later = i + 1 < count ? values_[i + 1].by_distance : here,
                 rise = step_ * (13 * (before + here) - earlier - later) / 24;
    values_[i].share = std::clamp(values_[i - 1].share + rise, 0.0, 1.0);
  }
}

TubeProfile::Value TubeProfile::at(double distance) const {
  const double place = distance / step_;
  const auto i = static_cast<std::size_t>(place);
  if (i + 1 >= values_.size()) return {0, 0, 0};
  const double t = place - static_cast<double>(i);
  const Value &a = values_[i], &b = values_[i + 1];
  return {std::lerp(a.share, b.share, t), std::lerp(a.by_radius, b.by_radius, t),
          std::lerp(a.by_distance, b.by_distance, t)};
}

}  // namespace xraycast
