#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/mechanics/hub.hpp"

#include <cstdint>

namespace xraycast {

/// One axis of the coupling; insertion in m, kg, N, rotation in rad, kg m2, N m.
struct CouplingAxis {
  double stiffness;     ///< between hand and hub, per m or rad
  double inertia;       ///< of the hub; with the stiffness it sets the damping, 2 sqrt(stiffness * inertia)
  double largest_load;  ///< that the hand shall feel and the hub be moved with
  double fastest;       ///< that the hub is led along and moves, per s
};

/// What holds the hub to the hand.
///
/// The defaults. A hand is told its load every T = 1 ms, and that is passive while the device's own damping
/// exceeds stiffness * T / 2 (Colgate and Schenkel, Passivity of a class of sampled-data systems, 1994): 0.25
/// N s/m and 1e-5 N m s/rad, about what gears and bearings have. A delay of the network counts in full on top
/// of T / 2. The inertia is small, since the damping that goes with it drags at the hand, by 2 N s/m and 4e-5
/// N m s/rad; and not smaller, since the rod's load reaches the hub a step late, which is stable while the
/// rod answers a step with less than 13 N/mm and 0.2 N m/rad. The presets in the thorax phantom answer with
/// at most 2 N/mm and 0.0024 N m/rad. 5 N and 0.05 N m are beyond what a catheter in a vessel bears, and
/// within what two fingers hold. No hand feeds a catheter faster than 250 mm/s or turns it faster than 4
/// turns/s.
struct CouplingSettings {
  CouplingAxis insertion{.stiffness = 500, .inertia = 0.002, .largest_load = 5, .fastest = 0.25};
  CouplingAxis rotation{.stiffness = 0.02, .inertia = 2e-8, .largest_load = 0.05, .fastest = 25};
  double patience_s = 0.1;  ///< without a pose, until the hub freezes
};

/// A hub on a critically damped spring whose other end the hand holds (Colgate, Stanley and Brown, Issues in
/// the haptic display of tool use, 1995). The hand feels the spring alone, so the hub's inertia and damping,
/// through which its motion is smooth, cannot feed energy into it.
///
/// A watchdog freezes the hub, and lets the hand go, where poses stop coming. When they come again, however
/// far off, the hub is led there no faster than a hand is.
///
/// Deterministic: time is what the caller steps it by.
class VirtualCoupling {
 public:
  explicit VirtualCoupling(const HubPose& start = {}, const CouplingSettings& settings = {});

  struct Step {
    HubPose hub;         ///< where the hub is at the end of the step
    HubLoad felt;        ///< what the hand shall feel
    bool frozen = true;  ///< no pose came for `patience_s`, or none yet, or not a number
  };

  /// The hub is there. Where the rod did not follow the last step, the hub stops.
  void stand_at(const HubPose& hub);

  /// A step of `step_s` under the hand's newest pose and the load that the rod puts on the hub.
  Step step(const HandPose& hand, const HubLoad& load, double step_s);

 private:
  struct AxisState {
    double led = 0;       ///< the spring's other end
    double position = 0;  ///< of the hub
    double velocity = 0;
  };
  bool poses_come(std::uint64_t count, double step_s);
  static double move(AxisState& state, const CouplingAxis& axis, double hand, double load, double step_s);

  CouplingSettings settings_;
  AxisState insertion_m_, rotation_rad_;
  std::uint64_t count_ = 0;  ///< of the newest pose
  double silence_s_;
};

}  // namespace xraycast
