#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/triple_buffer.hpp"

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace xraycast {

/// Timing of the loop against its deadlines.
struct LoopTiming {
  std::int64_t steps = 0;
  std::int64_t missed = 0;  ///< steps that ended after the next one was due
  double mean_ms = 0;       ///< of a step's computation
  double p999_ms = 0;       ///< the 99.9th percentile, to a hundredth of a millisecond
  double longest_ms = 0;
};

/// An instrument's state at one time.
struct InstrumentSnapshot {
  HubPose pose;
  HubLoad load;
  InstrumentTip tip;
  std::vector<glm::dvec3> nodes_mm;  ///< from the introducer's outer end to the tip
  std::vector<InstrumentContact> contacts;
  double balloon_bar = 0;                               ///< see Instruments
  std::vector<YieldingWalls::Opening> balloon_lengths;  ///< likewise
  int carried_rings = 0;                                ///< likewise
  std::optional<PushedCoil> coil;                       ///< likewise
};

/// What treatments made of the vessels.
struct TreatedVessels {
  YieldingWalls walls;
  std::vector<PlacedStent> stents;
};

/// What coils made of the sacs of aneurysms, one a sac.
struct CoiledSac {
  double packing = 0, wire_mm = 0;  ///< see CoilPack
  std::vector<LaidCoil> coils;
};

/// Why an exchange was refused, in one line that says what to do.
struct ExchangeRefusal {
  std::size_t instrument = 0;
  std::string why;
};

/// The state of coaxial instruments at one time: that of the outermost, and of those in it.
struct CatheterSnapshot : InstrumentSnapshot {
  std::vector<InstrumentSnapshot> inner;  ///< from outside on
  /// From the outermost on; another list after each exchange.
  std::shared_ptr<const std::vector<InstrumentModel>> instruments;
  std::shared_ptr<const ExchangeRefusal> refusal;  ///< of the last exchange; null: it was made, or none was
  std::int64_t exchanges = 0;                      ///< answered so far, made or refused
  std::optional<std::size_t> agent_outlet;
  double agent_lumen_mm = 0;                             ///< see the function
  std::vector<double> phases;                            ///< of the body's motion; none without a motion
  std::shared_ptr<const TreatedVessels> treated;         ///< another one after each change; null: none yet
  std::shared_ptr<const std::vector<CoiledSac>> coiled;  ///< likewise
  double time_s = 0;
  LoopTiming timing;

  std::size_t count() const { return 1 + inner.size(); }
  const InstrumentSnapshot& instrument(std::size_t number) const {
    return number == 0 ? static_cast<const InstrumentSnapshot&>(*this) : inner[number - 1];
  }
};

/// Steps coaxial instruments, or one alone, in its own thread, one step every step_s() of the clock, from
/// construction to destruction. A late step is caught up with; after a tenth of a second of delay (a machine
/// that was suspended) the clock is reset.
class SimulationLoop {
 public:
  /// Called before each step in the loop's thread with the hubs' poses, their loads and the step's duration;
  /// returns the poses to move to. Must not block.
  using Hand = std::function<std::span<const HubPose>(std::span<const HubPose> hubs,
                                                      std::span<const HubLoad> loads, double step_s)>;

  /// Called after each exchange in the loop's thread: this instrument is another one, at an insertion of 0.
  using Exchanged = std::function<void(std::size_t instrument, const InstrumentModel& model)>;

  /// Called before each step in the loop's thread with the step's duration; returns the phases to which the
  /// body moves in it (see Instruments::step). Must not block.
  using Body = std::function<std::span<const double>(double step_s)>;

  /// Called in the loop's thread before the first step, after each one, and after each exchange, then with
  /// the instrument's number. Must not block.
  using Watch = std::function<void(const Instruments& instruments, std::optional<std::size_t> exchanged)>;

  SimulationLoop(std::unique_ptr<Instruments> instruments, Hand hand, Exchanged exchanged = {},
                 Body body = {}, Watch watch = {});
  ~SimulationLoop();
  SimulationLoop(const SimulationLoop&) = delete;
  SimulationLoop& operator=(const SimulationLoop&) = delete;

  /// The newest state, valid until the next call. For one reading thread, on which the loop never waits.
  /// Rethrows the exception that ended the loop, if any.
  const CatheterSnapshot& snapshot() {
    if (failed_) std::rethrow_exception(failure_);
    return snapshots_.read();
  }

  /// Asks for another model instead of an instrument, for any thread. The loop makes it between two of its
  /// steps, as Instruments::exchange does, or refuses it; a snapshot says which. Simulated time stands
  /// still while the instrument settles, for some 50 ms. A request takes the place of one that is not yet
  /// answered.
  void exchange(std::size_t instrument, const InstrumentModel& model);

 private:
  void run();
  void step_until_stopped();
  bool exchange_if_asked();
  void list_instruments();
  void watch(std::optional<std::size_t> exchanged = {}) const {
    if (watch_) watch_(*instruments_, exchanged);
  }
  void publish();
  void publish(std::size_t instrument, InstrumentSnapshot& snapshot);
  void count(double step_ms, bool is_late);

  std::unique_ptr<Instruments> instruments_;
  Hand hand_;
  Exchanged exchanged_;
  Body body_;  ///< none: the body stays as it is
  Watch watch_;
  std::vector<HubPose> hubs_;
  std::vector<HubLoad> loads_;
  long vessel_changes_ = 0, coil_changes_ = 0;  ///< that were published
  CatheterSnapshot next_;
  TripleBuffer<CatheterSnapshot> snapshots_;
  double sum_ms_ = 0;
  std::vector<std::int64_t> histogram_;  ///< of step times, in hundredths of a millisecond
  struct Request {
    std::size_t instrument;
    InstrumentModel model;
  };
  std::mutex request_mutex_;
  std::optional<Request> request_;
  std::atomic<bool> is_asked_{false};  ///< there is a request, so that a step without one takes no lock
  std::atomic<bool> stops_{false};
  std::exception_ptr failure_;  ///< written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
