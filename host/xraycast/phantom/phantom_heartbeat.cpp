#include "xraycast/phantom/monotone_profile.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kBeat_s = 60.0 / 70;

/// How far the heart has contracted, in tenths of the beat since the R wave: out until 0.4, quickly in until
/// 0.6, at rest, and filled by the atria at the end.
constexpr std::array kContraction{0.0, 0.12, 0.54, 0.87, 1.0, 0.82, 0.40, 0.21, 0.17, 0.12};

/// The Catmull-Rom spline through kContraction, which is closed.
double contraction(double phase) {
  constexpr std::size_t kCount = kContraction.size();
  const double place = (phase - std::floor(phase)) * kCount;
  const auto i = std::min(static_cast<std::size_t>(place), kCount - 1);
  const double t = place - static_cast<double>(i);
  const auto at = [&](std::size_t k) { return kContraction[k % kCount]; };
  const double p0 = at(i + kCount - 1), p1 = at(i), p2 = at(i + 1), p3 = at(i + 2);
  return p1 + 0.5 * t * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)));
}

/// Of the heart at the end of systole. Heights are in mm from the apex along the long axis to the base.
struct Systole {
  static constexpr double kBaseDescent_mm = 14, kSqueeze = 0.65;
  /// From the axis: of the squeeze, and of what fades beyond the heart's surface.
  static constexpr double kSqueezed_mm = 58, kSurface_mm = 48, kReach_mm = 74;
  MonotoneProfile descent{{{-10, 0}, {0, 0}, {20, 0.2}, {60, 0.72}, {82, 1}, {96, 1}, {165, 0}}};
  MonotoneProfile squeeze{{{-25, 0}, {10, 0.8}, {35, 1}, {70, 1}, {95, 0.45}, {125, 0}}};
  MonotoneProfile twist_deg{{{-25, 0}, {14, 13}, {95, -3.2}, {135, 0}}};
};

}  // namespace

PhantomMode heart_mode() {
  PhantomMode mode{.name = "heart", .period_s = kBeat_s};
  for (std::size_t i = 0; i < kContraction.size(); ++i)
    mode.keys.push_back(static_cast<double>(i) / static_cast<double>(kContraction.size()));
  mode.share = contraction;
  // The reach about the long axis, from beyond the apex to the aortic arch.
  mode.lower_mm = {-100, -145, -14};
  mode.upper_mm = {142, 82, 220};
  mode.displacement_mm = [body = TrunkRegions(), systole = Systole()](const glm::dvec3& x) -> glm::dvec3 {
    const glm::dvec3 towards_apex = kHeartAxis, from_apex = x - kHeartApex_mm;
    const double height = -glm::dot(from_apex, towards_apex);
    const glm::dvec3 outwards = from_apex + height * towards_apex;
    const double r = glm::length(outwards);
    if (height <= -25 || height >= 165 || r >= Systole::kReach_mm) return {0, 0, 0};
    const double freedom = body.freedom(x);
    if (freedom == 0) return {0, 0, 0};

    // The base comes down; the walls come in, and the more the nearer to the cavity; the apex turns
    // anticlockwise as seen from below it. All fade beyond the heart's surface.
    const double q = std::min(r / Systole::kSqueezed_mm, 1.0);
    const double widening = 1 + Systole::kSqueeze * systole.squeeze(height) * std::pow(1 - q * q, 5);
    const double fade = 1 - glm::smoothstep(Systole::kSurface_mm, Systole::kReach_mm, r);
    const double turn = -fade * systole.twist_deg(height) * std::numbers::pi / 180;
    const glm::dvec3 rest =
        widening * (std::cos(turn) * outwards + std::sin(turn) * glm::cross(towards_apex, outwards));
    return freedom *
           (rest - outwards - fade * Systole::kBaseDescent_mm * systole.descent(height) * towards_apex);
  };
  return mode;
}

}  // namespace xraycast
