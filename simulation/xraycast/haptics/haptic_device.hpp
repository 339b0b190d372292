#pragma once

#include "xraycast/catheter/hub.hpp"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace xraycast {

/// The pose that a haptic device commands.
struct HandPose {
  HubPose pose;
  std::uint64_t count = 0;  ///< poses received so far: grows while the device is alive, moved or not
};

/// A device that commands the poses of the hubs, that of the outermost instrument being number 0, and renders
/// their loads to the hand.
///
/// `pose`, `set_load` and `go_on_from` are called at 1 kHz by the simulation's thread and must not block,
/// whatever the device or a network does. `status` may be called by any other thread.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  /// The newest pose. Throws what ended the thread that serves the device, if it has one of its own.
  virtual HandPose pose(std::size_t hub) = 0;

  /// Renders `load` to the hand from now on.
  virtual void set_load(std::size_t hub, const HubLoad& load) = 0;

  /// The hub was moved here by another one: its poses go on from there.
  virtual void go_on_from(std::size_t hub, const HubPose& pose) = 0;

  /// Holds this hub from now on, for any one thread. It leads where hubs are locked to each other.
  void hold(std::size_t hub) { held_.store(hub, std::memory_order_relaxed); }
  std::size_t held() const { return held_.load(std::memory_order_relaxed); }

  /// Whether the poses are the hub's own, as a script's are, without a virtual coupling in between.
  virtual bool is_rigid() const { return false; }

  /// Whether a hand feels the loads.
  virtual bool renders_loads() const { return true; }

  /// One line for the user: what is connected, and its rate.
  virtual std::string status() const = 0;

 private:
  std::atomic<std::size_t> held_{0};
};

}  // namespace xraycast
