#pragma once

#include "xraycast/mechanics/hub.hpp"

#include <cstdint>
#include <string>

namespace xraycast {

/// The pose that a haptic device commands.
struct HandPose {
  HubPose pose;
  std::uint64_t count = 0;  ///< poses received so far: grows while the device is alive, moved or not
};

/// A device that commands the hub's pose and renders the hub's load to the hand.
///
/// `pose` and `feel` are called at 1 kHz by the simulation's thread and must not block, whatever the device
/// or a network does. `status` may be called by any other thread.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  /// The newest pose. Throws what ended the thread that serves the device, if it has one of its own.
  virtual HandPose pose() = 0;

  /// Renders `load` to the hand from now on.
  virtual void feel(const HubLoad& load) = 0;

  /// Whether the poses are the hub's own, as a script's are, without a virtual coupling in between.
  virtual bool is_rigid() const { return false; }

  /// One line for the user: what is connected, and its rate.
  virtual std::string status() const = 0;
};

}  // namespace xraycast
