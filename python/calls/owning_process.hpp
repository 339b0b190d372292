#pragma once

#include <atomic>
#include <sys/types.h>
#include <unistd.h>

namespace xraycast::python {

/// The process that uses what does not survive a fork, such as a driver's threads. Asked before any lock is
/// taken: in a forked process another thread's lock stays locked.
class OwningProcess {
 public:
  /// Makes this process the owner where there is none. False where another process is.
  bool claim() {
    pid_t owner = 0;
    return pid_.compare_exchange_strong(owner, getpid()) || owner == getpid();
  }
  bool is_this() const { return pid_ == getpid(); }
  bool is_another() const { return pid_ != 0 && !is_this(); }

 private:
  std::atomic<pid_t> pid_{0};
};

}  // namespace xraycast::python
