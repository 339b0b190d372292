#include "xraycast/motion/heartbeat_model.hpp"

#include "xraycast/motion/monotone_profile.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace xraycast::heartbeat_model {
namespace {

/// In tenths of the beat: out until 0.4, quickly in until 0.6, at rest, and filled by the atria at the end.
constexpr std::array kContraction{0.0, 0.12, 0.54, 0.87, 1.0, 0.82, 0.40, 0.21, 0.17, 0.12};

// Of a heart of Heart::kLength_mm and kRadius_mm at the end of systole, by mm from the apex along the axis.
constexpr double kBaseDescent_mm = 14, kSqueeze = 0.65;
/// From the axis: of the squeeze, and of what fades beyond the heart's surface.
constexpr double kSqueezed_mm = 58, kReach_mm = 74;
constexpr double kLowest_mm = -25, kHighest_mm = 165;

struct Profiles {
  MonotoneProfile descent{{{-10, 0}, {0, 0}, {20, 0.2}, {60, 0.72}, {82, 1}, {96, 1}, {kHighest_mm, 0}}};
  MonotoneProfile squeeze{{{kLowest_mm, 0}, {10, 0.8}, {35, 1}, {70, 1}, {95, 0.45}, {125, 0}}};
  MonotoneProfile twist_deg{{{kLowest_mm, 0}, {14, 13}, {95, -3.2}, {135, 0}}};
};

double along(const Heart& heart) { return heart.length_mm / Heart::kLength_mm; }
double across(const Heart& heart) { return heart.radius_mm / Heart::kRadius_mm; }

}  // namespace

std::vector<double> keys() {
  std::vector<double> phases;
  for (std::size_t i = 0; i < kContraction.size(); ++i)
    phases.push_back(static_cast<double>(i) / static_cast<double>(kContraction.size()));
  return phases;
}

double contraction(double phase) {
  constexpr std::size_t kCount = kContraction.size();
  const double place = (phase - std::floor(phase)) * kCount;
  const auto i = std::min(static_cast<std::size_t>(place), kCount - 1);
  const double t = place - static_cast<double>(i);
  const auto at = [&](std::size_t k) { return kContraction[k % kCount]; };
  const double p0 = at(i + kCount - 1), p1 = at(i), p2 = at(i + 1), p3 = at(i + 2);
  return p1 + 0.5 * t * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)));
}

glm::dvec3 systole_mm(const Heart& heart, const glm::dvec3& x_mm) {
  static const Profiles profiles;
  const glm::dvec3 from_apex = x_mm - heart.apex_mm;
  const double height_mm = -glm::dot(from_apex, heart.axis), height = height_mm / along(heart);
  const glm::dvec3 outwards = from_apex + height_mm * heart.axis;
  const double r = glm::length(outwards) / across(heart);
  if (height <= kLowest_mm || height >= kHighest_mm || r >= kReach_mm) return {0, 0, 0};
  const double q = std::min(r / kSqueezed_mm, 1.0);
  const double widening = 1 + kSqueeze * profiles.squeeze(height) * std::pow(1 - q * q, 5);
  const double fade = 1 - glm::smoothstep(Heart::kRadius_mm, kReach_mm, r);
  const double turn = -fade * profiles.twist_deg(height) * std::numbers::pi / 180;
  const glm::dvec3 rest =
      widening * (std::cos(turn) * outwards + std::sin(turn) * glm::cross(heart.axis, outwards));
  return rest - outwards - fade * kBaseDescent_mm * along(heart) * profiles.descent(height) * heart.axis;
}

Reach reach_of(const Heart& heart) {
  return {kReach_mm * across(heart), kLowest_mm * along(heart), kHighest_mm * along(heart)};
}

}  // namespace xraycast::heartbeat_model
