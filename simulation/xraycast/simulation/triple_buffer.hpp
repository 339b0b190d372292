#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace xraycast {

/// Passes the newest value from one thread to another, wait-free on both sides: the writer owns one slot, the
/// reader another, and the third is exchanged.
template <typename T>
class TripleBuffer {
 public:
  /// For the writing thread.
  void write(const T& value) {
    slots_[back_] = value;
    back_ = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel) & kSlot;
  }

  /// The newest value written, `T{}` before the first; for the reading thread, valid until its next call.
  const T& read() {
    if (middle_.load(std::memory_order_relaxed) & kFresh)
      front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kSlot;
    return slots_[front_];
  }

 private:
  static constexpr std::uint8_t kSlot = 3, kFresh = 4;
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free);
  std::array<T, 3> slots_{};
  std::uint8_t back_ = 0;
  std::atomic<std::uint8_t> middle_{1};  ///< the slot's index, and whether it was written since the last read
  std::uint8_t front_ = 2;
};

}  // namespace xraycast
