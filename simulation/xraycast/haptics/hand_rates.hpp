#pragma once

#include <numbers>

namespace xraycast {

/// How fast a hand without a haptic device moves a hub, at most and for fine motion, and injects contrast
/// agent.
inline constexpr double kPush_mm_s = 40, kRotate_rad_s = 120 * std::numbers::pi / 180, kSlowly = 0.2;
inline constexpr double kInjection_ml_s = 5;

}  // namespace xraycast
