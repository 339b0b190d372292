#pragma once

#include "xraycast/simulation/run_monitor.hpp"

#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What is counted of a run that goes on in a thread of its own, which adds, while another thread reads. They
/// wait for each other for microseconds, and for a millisecond where a long run's values over time are read.
class LiveMonitor {
 public:
  /// With an exercise, as it begins, or none.
  explicit LiveMonitor(std::optional<ExerciseProgress> progress) : progress_(std::move(progress)) {}

  /// Before the first step and after each one; `exchanged`: another instrument has taken this one's place
  /// instead.
  void add(const Instruments& instruments, std::optional<std::size_t> exchanged);

  /// What has been used so far, from now on.
  void use(const RunUse& use);

  /// Of the exercise; none where there is none.
  std::optional<ExerciseState> state() const;

  /// As RunMonitor::json; empty before the first step.
  std::string json(bool has_series) const;

  /// As in_words of its exercise; empty without one.
  std::string words() const;

 private:
  std::optional<RunMonitor> copy() const;

  mutable std::mutex mutex_;  ///< of all below
  std::optional<ExerciseProgress> progress_;
  std::optional<RunMonitor> monitor_;
  RunUse use_;
};

}  // namespace xraycast
