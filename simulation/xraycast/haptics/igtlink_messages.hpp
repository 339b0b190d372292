#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/haptics/hub_name.hpp"

#include <array>
#include <cstddef>
#include <igtlSensorMessage.h>
#include <igtlStatusMessage.h>
#include <string>

namespace xraycast {

/// Serialises the OpenIGTLink messages that a haptic client receives, header version 1. Not thread-safe.
class IgtlinkMessages {
 public:
  IgtlinkMessages();

  /// Two SENSOR messages, since each has one unit for all its values: `HubForce`, three values in N, and
  /// `HubTorque`, three values in N m, upon the hand, along the axes of the TRANSFORM it sends. What resists
  /// pushing and right-handed rotation is thus negative along z. Those of the second device are `HubForce2`
  /// and `HubTorque2`, and so on.
  std::string load(std::size_t hub, const HubLoad& load);

  /// A STATUS message; `code` is one of igtl::StatusMessage's.
  std::string status(int code, const std::string& text);

 private:
  // Kept, since the library's factory is not thread-safe either.
  std::array<igtl::SensorMessage::Pointer, kMaxHubs> forces_, torques_;
  igtl::StatusMessage::Pointer status_;
};

}  // namespace xraycast
