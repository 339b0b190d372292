#include "xraycast/network/listen_address.hpp"

#include "xraycast/base/error.hpp"

#include <charconv>

namespace xraycast {

ListenAddress parse_listen_address(const std::string& text) {
  const auto colon = text.rfind(':');
  const std::string host = text.substr(0, colon);
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  ListenAddress address{.host = bracketed ? host.substr(1, host.size() - 2) : host};

  const char* const end = text.data() + text.size();
  const char* const digits = colon == std::string::npos ? end : text.data() + colon + 1;
  const auto [stop, error] = std::from_chars(digits, end, address.port);
  const bool host_is_good = !host.empty() && (bracketed || host.find_first_of("[]:") == std::string::npos);
  if (!host_is_good || error != std::errc() || stop != end)
    throw InputError("{}: give ADDRESS:PORT, such as 127.0.0.1:18944 or [::1]:18944", text);
  return address;
}

std::string to_string(const ListenAddress& address) {
  const bool is_v6 = address.host.find(':') != std::string::npos;
  return is_v6 ? fmt::format("[{}]:{}", address.host, address.port)
               : fmt::format("{}:{}", address.host, address.port);
}

}  // namespace xraycast
