#pragma once

#include "xraycast/haptics/haptic_device.hpp"

#include <atomic>
#include <string>

namespace xraycast {

/// Keys, a mouse or a gamepad set the hub's velocity. No force feedback.
class ManualDevice final : public HapticDevice {
 public:
  explicit ManualDevice(std::string name) : name_(std::move(name)) {}

  /// For one other thread.
  void set_rates(double insertion_mm_s, double rotation_rad_s) {
    insertion_mm_s_.store(insertion_mm_s, std::memory_order_relaxed);
    rotation_rad_s_.store(rotation_rad_s, std::memory_order_relaxed);
  }

  /// Immediately, as by a mouse wheel; for the same thread.
  void move_by(double insertion_mm, double rotation_rad) {
    insertion_jump_mm_.store(insertion_jump_mm_.load(std::memory_order_relaxed) + insertion_mm,
                             std::memory_order_relaxed);
    rotation_jump_rad_.store(rotation_jump_rad_.load(std::memory_order_relaxed) + rotation_rad,
                             std::memory_order_relaxed);
  }

  HandPose pose() override {
    constexpr double kCall_s = 1e-3;  // see HapticDevice
    driven_.insertion_mm += kCall_s * insertion_mm_s_.load(std::memory_order_relaxed);
    driven_.rotation_rad += kCall_s * rotation_rad_s_.load(std::memory_order_relaxed);
    const double jump_mm = insertion_jump_mm_.load(std::memory_order_relaxed);
    // The hub does not leave the introducer, and pulling any further is discarded.
    if (driven_.insertion_mm + jump_mm < 0) driven_.insertion_mm = -jump_mm;
    return {{driven_.insertion_mm + jump_mm,
             driven_.rotation_rad + rotation_jump_rad_.load(std::memory_order_relaxed)},
            ++count_};
  }

  void feel(const HubLoad&) override {}
  std::string status() const override { return name_; }

 private:
  std::string name_;
  std::atomic<double> insertion_mm_s_{0}, rotation_rad_s_{0}, insertion_jump_mm_{0}, rotation_jump_rad_{0};
  HubPose driven_;
  std::uint64_t count_ = 0;
};

}  // namespace xraycast
