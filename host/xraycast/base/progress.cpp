#include "xraycast/base/progress.hpp"

#include "xraycast/base/error.hpp"

namespace xraycast {

void Progress::begin(std::string stage, std::int64_t total, std::string unit) {
  check();
  const std::lock_guard lock(mutex_);
  state_ = {std::move(stage), std::move(unit), 0, total};
  if (listener_) listener_(state_);
}

void Progress::advance(std::int64_t n) {
  check();
  const std::lock_guard lock(mutex_);
  state_.done += n;
  if (listener_) listener_(state_);
}

void Progress::check() const {
  if (cancelled()) throw Cancelled();
}

}  // namespace xraycast
