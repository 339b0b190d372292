#pragma once

#include "xraycast/mechanics/hub.hpp"

#include <cstdint>
#include <string>

namespace xraycast {

/// What a haptic device commands, and whether it still does.
struct HandPose {
  HubPose pose;
  std::uint64_t count = 0;  ///< poses received so far; a device that is alive keeps counting, moved or not
};

/// A hand on the hub: a device that says where the hub should be and lets the hand feel what pushes back.
///
/// `pose` and `feel` are called at 1 kHz by the simulation's thread; both return at once, whatever the device
/// or a network does. `status` is for people and may be called by any other thread.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  /// The newest pose. Throws what ended the thread that serves the device, if it has one of its own.
  virtual HandPose pose() = 0;

  /// From now on the hand shall feel `load`.
  virtual void feel(const HubLoad& load) = 0;

  /// The poses are the hub's own, as a script has them: no spring lies between.
  virtual bool is_rigid() const { return false; }

  /// One line: what is connected, how often it speaks.
  virtual std::string status() const = 0;
};

}  // namespace xraycast
