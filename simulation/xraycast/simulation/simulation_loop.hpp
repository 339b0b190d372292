#pragma once

#include "xraycast/mechanics/catheter.hpp"
#include "xraycast/simulation/triple_buffer.hpp"

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

namespace xraycast {

/// How the loop keeps its time.
struct LoopTiming {
  std::int64_t steps = 0;
  std::int64_t missed = 0;  ///< steps that ended after the next one should have begun
  double mean_ms = 0;       ///< of a step's work
  double p999_ms = 0;       ///< 99.9 % of the steps took no longer; to a hundredth of a millisecond
  double longest_ms = 0;
};

/// A catheter at one moment.
struct CatheterSnapshot {
  double time_s = 0;
  HubPose pose;
  HubLoad load;
  CatheterTip tip;
  std::vector<glm::dvec3> nodes_mm;  ///< from the introducer's far end to the tip; see curve_through
  std::vector<CatheterContact> contacts;
  LoopTiming timing;
};

/// Steps a catheter in a thread of its own, one step every step_s() of the clock, from construction to
/// destruction. A step that comes late is made up for; after a tenth of a second of delay (a machine that
/// slept) the clock is set anew.
class SimulationLoop {
 public:
  /// Called before each step in the loop's thread: gets where the hub is, what it feels and the length of a
  /// step, and says where the hub should be. Returns at once.
  using Hand = std::function<HubPose(const HubPose& hub, const HubLoad& load, double step_s)>;

  SimulationLoop(std::unique_ptr<Catheter> catheter, Hand hand);
  ~SimulationLoop();
  SimulationLoop(const SimulationLoop&) = delete;
  SimulationLoop& operator=(const SimulationLoop&) = delete;

  /// The newest state, valid until the next call; for one reading thread, which the loop never waits for.
  /// Throws what the hand or the catheter threw in the loop's thread, which ended the loop.
  const CatheterSnapshot& snapshot() {
    if (failed_) std::rethrow_exception(failure_);
    return snapshots_.read();
  }

 private:
  void run();
  void step_until_stopped();
  void publish();
  void count(double step_ms, bool is_late);

  std::unique_ptr<Catheter> catheter_;
  Hand hand_;
  CatheterSnapshot next_;
  TripleBuffer<CatheterSnapshot> snapshots_;
  double sum_ms_ = 0;
  std::vector<std::int64_t> histogram_;  ///< of the steps' times, by hundredths of a millisecond
  std::atomic<bool> stops_{false};
  std::exception_ptr failure_;  ///< written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
