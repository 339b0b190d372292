#include "xraycast/serving/live_monitor.hpp"

#include <utility>

namespace xraycast {

void LiveMonitor::add(const Instruments& instruments, std::optional<std::size_t> exchanged) {
  const auto name_of = [&](std::size_t d) { return instruments.rod(d).instrument().name(); };
  const std::lock_guard lock(mutex_);
  if (!monitor_) {
    std::vector<std::string> names;
    for (std::size_t d = 0; d < instruments.count(); ++d) names.push_back(name_of(d));
    monitor_.emplace(instruments, std::move(names), progress_);
  } else if (exchanged) {
    monitor_->exchanged(*exchanged, instruments, name_of(*exchanged));
  } else {
    monitor_->add(instruments, use_);
  }
}

void LiveMonitor::use(const RunUse& use) {
  const std::lock_guard lock(mutex_);
  use_ = use;
}

std::optional<ExerciseState> LiveMonitor::state() const {
  const std::lock_guard lock(mutex_);
  const ExerciseProgress* const now = monitor_ ? monitor_->progress() : progress_ ? &*progress_ : nullptr;
  return now ? std::optional(now->state()) : std::nullopt;
}

/// Its text is made without the lock.
std::optional<RunMonitor> LiveMonitor::copy() const {
  const std::lock_guard lock(mutex_);
  return monitor_;
}

std::string LiveMonitor::json(bool has_series) const {
  const std::optional<RunMonitor> now = copy();
  return now ? now->json(has_series) : std::string();
}

std::string LiveMonitor::words() const {
  const std::lock_guard lock(mutex_);
  const ExerciseProgress* const now = monitor_ ? monitor_->progress() : nullptr;
  return now ? in_words(*now) : std::string();
}

}  // namespace xraycast
