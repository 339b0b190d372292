#pragma once

#include "xraycast/mechanics/hub.hpp"

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
  /// pushing and right-handed rotation is thus negative along z.
  std::string load(const HubLoad& load);

  /// A STATUS message; `code` is one of igtl::StatusMessage's.
  std::string status(int code, const std::string& text);

 private:
  // Kept, since the library's factory is not thread-safe either.
  igtl::SensorMessage::Pointer force_, torque_;
  igtl::StatusMessage::Pointer status_;
};

}  // namespace xraycast
