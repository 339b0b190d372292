#pragma once

#include "xraycast/motion/motion.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What an ECG shows at a phase of the heart, the share of the beat since the R wave; 0 at the S wave, 1 at
/// the R wave. Drawn, not measured: the P, Q, R, S and T waves are the five Gaussians of McSharry et al.
/// (IEEE Trans. Biomed. Eng. 50, 2003), with the places, widths and amplitudes of their table 1, scaled to 0
/// to 1. Any finite phase; it repeats with 1.
double ecg(double heart_phase);

/// The clock of a body in motion: the phase of each of its modes as time advances. A mode has a time of its
/// own, which stops while the mode is held and passes faster or slower with its speed; so nothing jumps when
/// a mode is released or its speed changes. A value; the same calls give the same phases.
///
/// Calls that name a mode throw InputError for a name that the motion does not have, and list its modes.
class BodyClock {
 public:
  /// All modes at a time of the motion, which is the clock's too.
  explicit BodyClock(const Motion& motion, double start_s = 0);

  /// Seconds pass, 0 or more.
  void advance(double seconds);

  /// The start and what has passed since.
  double time_s() const { return time_s_; }

  /// One phase a mode, in the motion's order, 0 to 1, as Motion::held_at takes them.
  std::vector<double> phases() const { return phases_at(time_s_); }

  /// The same at another time, before or after now, as if holds and speeds were always what they are now.
  std::vector<double> phases_at(double time_s) const;

  /// What a monitor shows of each mode, in order, at such a time, 0 to 1: of a mode `heart` its ecg(), of any
  /// other one its phase. An ECG wants 200 samples a second or more.
  std::vector<double> traces_at(double time_s) const;

  /// The names of the modes, in the motion's order.
  std::vector<std::string> names() const;

  /// Stops a mode where it is, as a patient's breath.
  void hold(const std::string& mode);

  /// Stops a mode at a phase, 0 to 1, at once. It takes the next time of its own at which it has this phase,
  /// and goes on from there when it is released. Throws InputError, with the field `phase`, for a phase that
  /// the mode never has.
  void hold(const std::string& mode, double phase);

  /// A mode goes on from the phase at which it was held.
  void release(const std::string& mode);
  bool is_held(const std::string& mode) const;

  /// How fast the time of a mode passes, 0 to 100; 1 at first. Throws InputError, with the field `speed`.
  void set_speed(const std::string& mode, double factor);

  /// The same of all modes.
  void set_speed(double factor);

  /// The first instant of the clock, at or after another, at which a mode has a phase, 0 to 1: when a gate
  /// opens. Holds and speeds stay as they are now. An instant less than a nanosecond before counts. Nothing
  /// where the mode never has this phase, or is held at another one. Of a mode that wraps, phases 0 and 1 are
  /// the same.
  std::optional<double> next_instant(const std::string& mode, double phase, double at_or_after_s) const;

 private:
  struct Mode {
    MotionMode motion;
    double time_s;  ///< of its own
    double speed = 1;
    bool is_held = false;

    /// How fast its time passes now.
    double rate() const { return is_held ? 0 : speed; }
  };

  double own_time_s(const Mode& mode, double time_s) const {
    return mode.time_s + mode.rate() * (time_s - time_s_);
  }
  std::size_t index_of(const std::string& name) const;

  double time_s_;
  std::vector<Mode> modes_;
};

}  // namespace xraycast
