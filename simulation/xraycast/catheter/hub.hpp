#pragma once

#include <cstddef>

namespace xraycast {

/// The most coaxial instruments whose hubs a hand moves.
inline constexpr std::size_t kMaxHubs = 3;

/// The pose of the hub, the catheter's outer end, which the hand holds.
struct HubPose {
  double insertion_mm = 0;   ///< length fed through the introducer; positive into the body
  double rotation_rad = 0;   ///< about the direction of insertion, right-handed; adds up over whole turns
  double inflation_bar = 0;  ///< pressure in the instrument's balloon above the blood's; 0: it is folded
  double release_mm = 0;  ///< how far the sheath of the instrument's stent is drawn back; it never goes back
  double detach = 0;      ///< how many coils were to be detached so far: one as it comes to a whole number
};

/// Force and torque on the hand at the hub, in SI units.
struct HubLoad {
  double force_N = 0;    ///< along the hub's axis; positive pushes the hand back, out of the body
  double torque_Nm = 0;  ///< about the direction of insertion; positive resists a positive rotation
};

/// A hub on its way to a pose.
struct MovingHub {
  // It moves no faster than a hand; a pose further ahead is approached at these speeds.
  static constexpr double kMaxSpeed_mm_s = 300, kMaxSpeed_rad_s = 30;
  /// Of an inflation device, that is turned or, to deflate, drawn back: chosen.
  static constexpr double kMaxInflation_bar_s = 10;
  /// Of a hand that draws a sheath back: chosen.
  static constexpr double kMaxRelease_mm_s = 50;

  /// Against a larger force an instrument buckles outside the introducer or slips through the fingers: the
  /// hub does not advance.
  static constexpr double kMaxPush_N = 3;

  HubPose pose;
  bool is_held = false;  ///< it does not advance, because of the force

  /// A step towards a pose, whose insertion, pressure and release are clamped to 0 to the largest, and its
  /// detachments to the largest.
  void approach(const HubPose& target, double force_N, const HubPose& largest, double step_s);
};

}  // namespace xraycast
