#pragma once

#include "xraycast/motion/body_clock.hpp"
#include "xraycast/trainer/browser_message.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The body of a Trainer in motion: its clock, which the simulation's steps advance, while whoever steers
/// holds modes, changes their speed and gates exposures. Modes are numbers in the motion's order.
class TrainerBody {
 public:
  static constexpr double kTrace_s = 0.005;  ///< between values of a trace
  static constexpr double kKept_s = 6;       ///< of a trace, while nobody is told

  explicit TrainerBody(std::shared_ptr<const Motion> motion);

  /// Time passes. The phases then, one a mode, valid until the next call.
  std::span<const double> advance(double seconds);

  const std::shared_ptr<const Motion>& motion() const { return motion_; }
  const std::vector<double>& phases() const { return phases_; }  ///< now

  /// A mode stops where it is, or at a phase of its own, or goes on. Throws InputError as BodyClock.
  void hold(std::size_t mode, std::optional<double> phase = {});
  void release(std::size_t mode);
  void set_speed(double factor);

  /// Exposures wait until a mode is at a phase; none: they do not. Throws InputError as BodyClock.
  struct Gate {
    std::size_t mode = 0;
    double phase = 0;
  };
  void set_gate(const std::optional<Gate>& gate);

  /// The phases of an exposure that is made now, one a mode: those at which the gate has opened since this
  /// was asked before. None: it is closed.
  std::optional<std::vector<double>> exposure_phases();

  /// Marks it in what is told.
  void mark_exposure();

  /// All of the body in a message, but the phases of the last exposure.
  void tell(BrowserMessage& message);

 private:
  void sample();

  std::shared_ptr<const Motion> motion_;
  BodyClock clock_;
  std::vector<std::string> names_;
  std::vector<double> phases_;
  double speed_ = 1, looked_s_ = 0, sampled_s_ = 0;
  std::optional<Gate> gate_;
  std::vector<std::vector<float>> traces_;  ///< since the last message
  std::vector<double> exposures_s_;
};

}  // namespace xraycast
