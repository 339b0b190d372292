#pragma once

#include "xraycast/base/progress.hpp"

#include <chrono>
#include <string>

namespace xraycast::cli {

/// Draws the progress of a job on one line of stderr, with rate and remaining time. Nothing where stderr is
/// not a terminal, and nothing for stages shorter than half a second.
class ProgressBar {
 public:
  explicit ProgressBar(bool enabled);
  ~ProgressBar() { clear(); }

  void show(const Progress::State& state);

  /// Removes the line, so that other output starts at the margin.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  bool enabled_;
  std::string stage_;
  Clock::time_point stage_start_, last_drawn_;
  bool drawn_ = false;
};

}  // namespace xraycast::cli
