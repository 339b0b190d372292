#include "xraycast/haptics/virtual_coupling.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

VirtualCoupling::VirtualCoupling(const HubPose& start, const CouplingSettings& settings)
    : settings_(settings),
      insertion_m_{start.insertion_mm / 1000, start.insertion_mm / 1000, 0},
      rotation_rad_{start.rotation_rad, start.rotation_rad, 0},
      silence_s_(settings.timeout_s) {}

void VirtualCoupling::synchronise(const HubPose& hub) {
  constexpr double kRounding = 1e-9;
  const auto move_to = [](AxisState& axis, double position) {
    if (std::abs(axis.position - position) < kRounding) return;
    axis.position = position;
    axis.velocity = 0;
  };
  move_to(insertion_m_, hub.insertion_mm / 1000);
  move_to(rotation_rad_, hub.rotation_rad);
}

VirtualCoupling::Step VirtualCoupling::step(const HandPose& hand, const HubLoad& load, double step_s) {
  Step result;
  const bool finite = std::isfinite(hand.pose.insertion_mm) && std::isfinite(hand.pose.rotation_rad) &&
                      std::isfinite(load.force_N) && std::isfinite(load.torque_Nm);
  if (is_alive(hand.count, step_s) && finite) {
    result.frozen = false;
    result.felt.force_N =
        move(insertion_m_, settings_.insertion, hand.pose.insertion_mm / 1000, load.force_N, step_s);
    result.felt.torque_Nm =
        move(rotation_rad_, settings_.rotation, hand.pose.rotation_rad, load.torque_Nm, step_s);
  } else {
    for (AxisState* const axis : {&insertion_m_, &rotation_rad_}) *axis = {axis->position, axis->position, 0};
  }
  result.hub = {.insertion_mm = insertion_m_.position * 1000, .rotation_rad = rotation_rad_.position};
  return result;
}

bool VirtualCoupling::is_alive(std::uint64_t count, double step_s) {
  silence_s_ = count != count_ ? 0 : silence_s_ + step_s;
  count_ = count;
  return silence_s_ < settings_.timeout_s - step_s / 2;  // half a step, for rounding of the sum
}

/// Implicit Euler for spring and damper, unconditionally stable; explicit in the rod's load. Returns the
/// spring's load on the hand.
double VirtualCoupling::move(AxisState& state, const CouplingAxis& axis, double hand, double load,
                             double step_s) {
  state.proxy += std::clamp(hand - state.proxy, -axis.max_speed * step_s, axis.max_speed * step_s);

  const double damping = 2 * std::sqrt(axis.stiffness * axis.inertia);
  const double momentum = axis.inertia * state.velocity - load * step_s;
  const double damped = axis.inertia + damping * step_s;
  const auto stretch = [&](double velocity) { return state.proxy - state.position - velocity * step_s; };

  double velocity =
      (momentum + axis.stiffness * stretch(0) * step_s) / (damped + axis.stiffness * step_s * step_s);
  const double spring = axis.stiffness * stretch(velocity);
  const double limited = std::clamp(spring, -axis.max_load, axis.max_load);
  if (limited != spring) velocity = (momentum + limited * step_s) / damped;
  state.velocity = std::clamp(velocity, -axis.max_speed, axis.max_speed);
  state.position += state.velocity * step_s;
  return limited;
}

}  // namespace xraycast
