#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/haptics/haptic_device.hpp"

#include <array>
#include <atomic>
#include <string>

namespace xraycast {

/// Keys, a mouse or a gamepad set the velocity of one hub at a time, the one that the hand holds. No force
/// feedback.
class ManualDevice final : public HapticDevice {
 public:
  explicit ManualDevice(std::string name) : name_(std::move(name)) {}

  // For one other thread.

  /// Of the hub that is held.
  void set_rates(double insertion_mm_s, double rotation_rad_s) {
    insertion_mm_s_.store(insertion_mm_s, std::memory_order_relaxed);
    rotation_rad_s_.store(rotation_rad_s, std::memory_order_relaxed);
  }

  /// Moves it immediately, as by a mouse wheel.
  void move_by(double insertion_mm, double rotation_rad) {
    Hub& hub = hubs_[held()];
    hub.jump_mm.store(hub.jump_mm.load(std::memory_order_relaxed) + insertion_mm, std::memory_order_relaxed);
    hub.jump_rad.store(hub.jump_rad.load(std::memory_order_relaxed) + rotation_rad,
                       std::memory_order_relaxed);
  }

  HandPose pose(std::size_t hub) override {
    constexpr double kCall_s = 1e-3;  // see HapticDevice
    Hub& of = hubs_[hub];
    if (hub == held()) {
      of.driven.insertion_mm += kCall_s * insertion_mm_s_.load(std::memory_order_relaxed);
      of.driven.rotation_rad += kCall_s * rotation_rad_s_.load(std::memory_order_relaxed);
    }
    const double jump_mm = of.jump_mm.load(std::memory_order_relaxed);
    // The hub does not leave the introducer, and pulling any further is discarded.
    if (of.driven.insertion_mm + jump_mm < 0) of.driven.insertion_mm = -jump_mm;
    return {{of.driven.insertion_mm + jump_mm,
             of.driven.rotation_rad + of.jump_rad.load(std::memory_order_relaxed)},
            ++of.count};
  }

  void go_on_from(std::size_t hub, const HubPose& pose) override {
    Hub& of = hubs_[hub];
    of.driven = {pose.insertion_mm - of.jump_mm.load(std::memory_order_relaxed),
                 pose.rotation_rad - of.jump_rad.load(std::memory_order_relaxed)};
  }
  void set_load(std::size_t, const HubLoad&) override {}
  bool renders_loads() const override { return false; }
  std::string status() const override { return name_; }

 private:
  struct Hub {
    std::atomic<double> jump_mm{0}, jump_rad{0};
    HubPose driven;
    std::uint64_t count = 0;
  };
  std::string name_;
  std::atomic<double> insertion_mm_s_{0}, rotation_rad_s_{0};
  std::array<Hub, kMaxHubs> hubs_;
};

}  // namespace xraycast
