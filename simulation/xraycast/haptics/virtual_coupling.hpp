#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/haptics/haptic_device.hpp"

#include <cstdint>

namespace xraycast {

/// One axis of the coupling; insertion in m, kg, N, rotation in rad, kg m2, N m.
struct CouplingAxis {
  double stiffness;  ///< between hand and hub, per m or rad
  double inertia;    ///< of the virtual hub; critical damping: 2 sqrt(stiffness * inertia)
  double max_load;   ///< of the spring, on the hand and on the hub
  double max_speed;  ///< of the spring's proxy and the hub, per s
};

/// Parameters of the virtual coupling between hand and hub.
///
/// The defaults. The load is sampled every T = 1 ms, which is passive while the device's own damping exceeds
/// stiffness * T / 2 (Colgate and Schenkel, Passivity of a class of sampled-data systems, 1994): 0.25 N s/m
/// and 1e-5 N m s/rad, about that of gears and bearings. A network delay adds to T / 2 in full. The inertia
/// is small, because the damping that goes with it is felt as drag, 2 N s/m and 4e-5 N m s/rad; and not
/// smaller, because the rod's load reaches the hub a step late, which is stable while the rod's stiffness at
/// the hub is less than 13 N/mm and 0.2 N m/rad. That of the presets in the thorax phantom is at most 2 N/mm
/// and 0.0024 N m/rad, also that of a wire which is drawn back to the introducer and sticks in a catheter
/// there (LumenContact). 5 N and 0.05 N m exceed the loads of a catheter in a vessel and are within the
/// strength of two fingers. No hand feeds a catheter faster than 250 mm/s or rotates it faster than 4
/// turns/s.
struct CouplingSettings {
  CouplingAxis insertion{.stiffness = 500, .inertia = 0.002, .max_load = 5, .max_speed = 0.25};
  CouplingAxis rotation{.stiffness = 0.02, .inertia = 2e-8, .max_load = 0.05, .max_speed = 25};
  double timeout_s = 0.1;  ///< of the watchdog: without a pose for so long the hub freezes

  /// Of a device without force feedback, which no stiffness makes unstable: fingers hold a hub that is not
  /// turned, and a load of 5 mN m turns it by 1.5 degrees.
  static CouplingSettings without_feedback() {
    CouplingSettings settings;
    settings.rotation.stiffness = 0.2;
    settings.rotation.inertia = 2e-7;
    return settings;
  }
};

/// A virtual hub on a critically damped spring whose other end the hand holds (Colgate, Stanley and Brown,
/// Issues in the haptic display of tool use, 1995). Only the spring's force is rendered, so that the virtual
/// hub's inertia and damping, which smooth its motion, cannot feed energy into the hand.
///
/// A watchdog freezes the hub and renders no load when poses stop arriving. When they resume, however far
/// away, the hub follows at the speed limit.
///
/// Deterministic: time advances by the caller's steps.
class VirtualCoupling {
 public:
  explicit VirtualCoupling(const HubPose& start = {}, const CouplingSettings& settings = {});

  struct Step {
    HubPose hub;         ///< where the hub is at the end of the step
    HubLoad felt;        ///< to be rendered to the hand
    bool frozen = true;  ///< no pose for `timeout_s`, or none yet, or not finite
  };

  /// Moves the virtual hub to the simulated one. Where the rod did not follow the last step, it stops.
  void synchronise(const HubPose& hub);

  /// A step of `step_s` under the hand's newest pose and the rod's load on the hub.
  Step step(const HandPose& hand, const HubLoad& load, double step_s);

 private:
  struct AxisState {
    double proxy = 0;     ///< the spring's other end, which follows the hand
    double position = 0;  ///< of the hub
    double velocity = 0;
  };
  bool is_alive(std::uint64_t count, double step_s);
  static double move(AxisState& state, const CouplingAxis& axis, double hand, double load, double step_s);

  CouplingSettings settings_;
  AxisState insertion_m_, rotation_rad_;
  std::uint64_t count_ = 0;  ///< of the newest pose
  double silence_s_;
};

}  // namespace xraycast
