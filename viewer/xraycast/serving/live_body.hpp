#pragma once

#include "xraycast/motion/body_request.hpp"

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// What an operator changes about a body in motion. What is left open stays as it is.
struct BodyChanges {
  /// A mode stops where it is, or at a phase of its own, or goes on.
  struct Hold {
    bool is_held = true;
    std::optional<double> phase{};
  };
  std::map<std::string, Hold> holds{};
  std::optional<double> speed{};
  std::optional<std::optional<PhaseGate>> gate{};  ///< no gate in it: exposures come as they are due

  bool is_empty() const { return holds.empty() && !speed && !gate; }

  /// Later changes on top.
  void add(const BodyChanges& later);
};

/// `hold breath`, `hold breath 0.5`, `release breath`, `speed 2`, `gate heart 0.75`, `gate off`. Throws
/// InputError for anything else.
BodyChanges parse_body_changes(const std::string& text);

/// A mode of a body, as its operator has it.
struct BodyModeState {
  std::string name;
  bool is_held = false;
  double phase = 0;
};

/// What a monitor shows of a body in its last seconds.
struct BodyTraces {
  static constexpr double kStep_s = 0.005, kKept_s = 6;
  double end_s = 0;        ///< of the newest samples
  std::int64_t count = 0;  ///< of samples so far
  std::vector<std::deque<float>>
      samples{};  ///< of each mode, kStep_s apart, 0 to 1; see BodyClock::traces_at
  std::deque<double> exposures_s{};
};

/// The body of a live session: its clock, which the simulation or a window advances while an operator holds
/// modes, changes their speed, and gates exposures; and what its monitor shows. advance() is for one thread,
/// all else for another.
class LiveBody {
 public:
  /// Of a request with a motion. Throws as `check` and clock_of.
  explicit LiveBody(const BodyRequest& request);

  /// Time passes. Returns the phases then, one a mode, valid until the next call. Waits for the other thread
  /// for microseconds at most.
  std::span<const double> advance(double seconds);

  const Motion& motion() const { return *motion_; }
  double time_s() const;
  std::vector<double> phases() const;
  std::vector<double> phases_at(double time_s) const;

  /// In the motion's order.
  std::vector<BodyModeState> modes() const;
  double speed() const { return speed_; }
  const std::optional<PhaseGate>& gate() const { return gate_; }

  /// Throws InputError for modes that it does not have, and phases and speeds out of range; what comes before
  /// is changed then.
  void change(const BodyChanges& changes);
  void toggle_hold(const std::string& mode);

  /// When an exposure is made now, in its time: now or, with a gate, when that has opened since the last
  /// call. One that opens within the patience is waited for. Nothing while it stays closed. Call once a
  /// frame.
  std::optional<double> exposure_s(double patience_s);

  /// The gate opens by itself again, as things are.
  bool opens_again() const;

  /// Once a frame: what has passed.
  const BodyTraces& traces();
  void mark_exposure(double time_s);

 private:
  void sample();
  void forget_exposures();
  double wait_until(double time_s, double longest_s) const;

  std::shared_ptr<const Motion> motion_;
  mutable std::mutex mutex_;
  BodyClock clock_;  ///< by the mutex
  std::vector<double> phases_;
  double speed_;
  std::optional<PhaseGate> gate_;
  double looked_s_ = 0;  ///< for an open gate
  BodyTraces traces_;
};

}  // namespace xraycast
