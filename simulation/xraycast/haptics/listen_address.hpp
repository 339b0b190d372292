#pragma once

#include <cstdint>
#include <string>

namespace xraycast {

/// Where a server listens. By default the IANA port of OpenIGTLink, for programs on this machine only.
struct ListenAddress {
  std::string host = "127.0.0.1";  ///< numeric, IPv4 or IPv6, or a name
  std::uint16_t port = 18944;      ///< 0 for any that is free
};

/// Reads ADDRESS:PORT, such as "127.0.0.1:18944" or "[::1]:18944"; 0.0.0.0 is every address of this machine.
/// Throws InputError.
ListenAddress parse_listen_address(const std::string& text);

/// The reverse.
std::string to_string(const ListenAddress& address);

}  // namespace xraycast
