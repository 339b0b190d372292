#pragma once

#include <glm/vec3.hpp>

#include <vector>

// How a heart beats. docs/motion.md lists values and sources.
namespace xraycast::heartbeat_model {

inline constexpr double kPeriod_s = 60.0 / 70;

/// Phases, shares of the beat since the R wave, evenly spaced from 0 on.
std::vector<double> keys();

/// How far the heart has contracted, 0 at the R wave and 1 at the end of systole: at the keys what is given,
/// between them the Catmull-Rom spline through these, which is closed.
double contraction(double phase);

/// Where a heart lies.
struct Heart {
  glm::dvec3 apex_mm;             ///< outer
  glm::dvec3 axis;                ///< unit vector, from the base to the apex
  double length_mm = kLength_mm;  ///< along it, with the atria
  double radius_mm = kRadius_mm;  ///< of the widest cross-section

  /// Of the heart for which the model's lengths hold; those of others are in proportion.
  static constexpr double kLength_mm = 132, kRadius_mm = 48;
};

/// The pull-back of a heart that has contracted: the base comes down; the walls come in, and the more the
/// nearer to the cavity; the apex turns anticlockwise as seen from below it, and stays. Fades beyond the
/// heart's surface.
glm::dvec3 systole_mm(const Heart& heart, const glm::dvec3& x_mm);

/// How far from the axis, and from the apex towards the base, it is not 0.
struct Reach {
  double aside_mm, lowest_mm, highest_mm;
};
Reach reach_of(const Heart& heart);

}  // namespace xraycast::heartbeat_model
