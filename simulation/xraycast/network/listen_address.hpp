#pragma once

#include <cstdint>
#include <string>

namespace xraycast {

/// Where a server listens. By default the IANA port of OpenIGTLink, reachable from this machine only.
struct ListenAddress {
  std::string host = "127.0.0.1";  ///< numeric, IPv4 or IPv6, or a name
  std::uint16_t port = 18944;      ///< 0: chosen by the system
};

/// Parses ADDRESS:PORT, such as "127.0.0.1:18944" or "[::1]:18944"; 0.0.0.0 is every address of this machine.
/// Throws InputError.
ListenAddress parse_listen_address(const std::string& text);

/// The inverse of parse_listen_address.
std::string to_string(const ListenAddress& address);

}  // namespace xraycast
