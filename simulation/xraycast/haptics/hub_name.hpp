#pragma once

#include <cstddef>
#include <string>

namespace xraycast {

/// The most coaxial devices whose hubs a hand moves.
inline constexpr std::size_t kMaxHubs = 3;

/// A device's message by its number: Tip, Tip2, Tip3.
inline std::string numbered(const std::string& name, std::size_t device) {
  return name + (device == 0 ? "" : std::to_string(device + 1));
}

/// Over OpenIGTLink, of the devices from the outermost on: Hub, Hub2, Hub3, and with an `ending` as HubForce,
/// HubForce2.
inline std::string hub_name(std::size_t hub, const std::string& ending = "") {
  return numbered("Hub" + ending, hub);
}

}  // namespace xraycast
