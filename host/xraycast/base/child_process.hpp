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

/// What a process that works apart may take.
struct ChildLimits {
  std::int64_t memory_B = 0;  ///< beyond what this process has now
  int processor_s = 30;       ///< of a core's time
  int wall_s = 300;           ///< for one that waits for ever
};

/// Runs `work` in a process of its own, a copy of this one, and waits for it: whatever a damaged file does to
/// a library there, this process goes on. Returns whether `work` returned; false where it threw, crashed or
/// ran into a limit. What it writes to SharedMemory stays, all else is lost; what it says on stderr goes
/// nowhere. May be called by several threads at once.
///
/// `work` must not start threads or wait for ones of this process, which its copy does not have. Throws Error
/// when no process can be started.
bool run_in_child(const std::function<void()>& work, const ChildLimits& limits);

}  // namespace xraycast
