#pragma once

#include "xraycast/motion/body_clock.hpp"
#include "xraycast/motion/motion.hpp"

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Exposures wait until a mode is at a phase, as with an ECG trigger.
struct PhaseGate {
  std::string mode;
  double phase = 0;  ///< 0 to 1

  bool operator==(const PhaseGate&) const = default;
};

/// A body that moves as time passes, as every front end asks for it: runs, cines, the window, a server.
/// Messages name the fields in backquotes, for with_names().
struct BodyRequest {
  std::shared_ptr<const Motion> motion{};  ///< null: the body is still
  std::map<std::string, double> phase{};   ///< of modes by name that are held, 0 to 1; all others go on
  double speed = 1;                        ///< of all modes, 0 to 100: 2 breathes and beats twice as fast
  std::optional<PhaseGate> gate{};         ///< none: exposures come as they are due
};

/// Throws InputError for anything about a motion without one, modes that it does not have, phases and a speed
/// out of range, and a gate that never opens.
void check(const BodyRequest& request);

/// Of the modes of the motion, in order, at a time that begins with the motion's; none without a motion.
std::vector<double> phases_at(const BodyRequest& request, double time_s);

/// The clock of such a body, which has a motion, at a time of the run. A mode whose waveform never has the
/// phase at which it is held throws as BodyClock::hold.
BodyClock clock_of(const BodyRequest& request, double time_s = 0);

/// When an exposure that is due at a time is made: when the gate opens next, without one at once.
double exposure_time_s(const BodyRequest& request, double due_s);

/// Whether an R wave, phase 0 of a mode `heart` that is not held, came after a time and until another.
bool has_r_wave_between(const BodyRequest& request, double after_s, double until_s);

/// `heart=0.75`. Throws InputError with the field `gate` in front.
PhaseGate parse_gate(const std::string& text);

}  // namespace xraycast
