#pragma once

#include <cstddef>
#include <string>

namespace xraycast {

/// The most coaxial devices whose hubs a hand moves.
inline constexpr std::size_t kMaxHubs = 3;

/// Over OpenIGTLink, of the devices from the outermost on: Hub, Hub2, Hub3, and with an `ending` as HubForce,
/// HubForce2.
inline std::string hub_name(std::size_t hub, const std::string& ending = "") {
  return "Hub" + ending + (hub == 0 ? "" : std::to_string(hub + 1));
}

}  // namespace xraycast
