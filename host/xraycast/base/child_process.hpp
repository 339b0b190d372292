#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

namespace xraycast {

/// Memory that a process shares with the ones it starts by run_in_child(); zero at first. Move-only.
class SharedMemory {
 public:
  /// Throws std::bad_alloc where there is none.
  explicit SharedMemory(std::size_t size_B);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  std::span<std::byte> bytes() const { return bytes_; }

 private:
  std::span<std::byte> bytes_;
};

/// Limits of a child process.
struct ChildLimits {
  std::int64_t memory_B = 0;  ///< beyond what this process has now
  int processor_s = 30;       ///< of a core's time
  int stall_s = 10;           ///< in which it takes none of the processor's time
  int wall_s = 300;           ///< against one that never ends
};

/// Runs `work` in a child process, a copy of this one, and waits for it: a library that crashes on a damaged
/// file there does not end this process. Returns whether `work` returned; false if it threw, crashed or
/// exceeded a limit. Its writes to SharedMemory remain, all else is lost; its stderr is discarded. Where it
/// stalls, as a library does on a lock that another thread held when the copy was made, it is run again,
/// three times in all. Several threads may call it at once.
///
/// `work` must not start threads or wait for ones of this process, which its copy does not have. Throws Error
/// when no process can be started.
bool run_in_child(const std::function<void()>& work, const ChildLimits& limits);

}  // namespace xraycast
