#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>

namespace xraycast {

/// Progress and cancellation of a long call. One object serves a whole job: the worker reports to it, and the
/// caller (a progress bar, a window, a signal handler) listens and may cancel.
///
/// Thread-safe. The listener runs on the reporting thread, one call at a time, and should return quickly.
class Progress {
 public:
  struct State {
    std::string stage;      ///< current activity, such as "reading"
    std::string unit;       ///< what `done` counts, such as "slices"
    std::int64_t done = 0;  ///< 0 to total
    std::int64_t total = 0;
    double fraction() const {
      return total > 0 ? static_cast<double>(done) / static_cast<double>(total) : 0.0;
    }
  };
  using Listener = std::function<void(const State&)>;

  Progress() = default;
  explicit Progress(Listener listener) : listener_(std::move(listener)) {}
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Starts a stage of `total` units. Throws Cancelled after cancel().
  void begin(std::string stage, std::int64_t total, std::string unit);

  /// Reports `n` more units done. Throws Cancelled after cancel().
  void advance(std::int64_t n = 1);

  /// Throws Cancelled after cancel(); for work that has no units to report.
  void check() const;

  /// Asks the job to stop. Safe in a signal handler.
  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const noexcept { return cancelled_.load(std::memory_order_relaxed); }

 private:
  static_assert(std::atomic<bool>::is_always_lock_free);
  std::atomic<bool> cancelled_{false};
  std::mutex mutex_;
  State state_;
  Listener listener_;
};

}  // namespace xraycast
