#include "xraycast/haptics/tcp_listener.hpp"

#include "xraycast/base/error.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <memory>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <system_error>

namespace xraycast {
namespace {

std::string address_text(const sockaddr_storage& address, socklen_t size_B, std::uint16_t* port = nullptr) {
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> service{};
  getnameinfo(reinterpret_cast<const sockaddr*>(&address), size_B, host.data(), host.size(), service.data(),
              service.size(), NI_NUMERICHOST | NI_NUMERICSERV);
  const auto number = static_cast<std::uint16_t>(std::atoi(service.data()));
  if (port != nullptr) *port = number;
  return to_string(ListenAddress{host.data(), number});
}

struct FreeAddresses {
  void operator()(addrinfo* list) const { freeaddrinfo(list); }
};

void set_option(const Descriptor& socket, int level, int name, int value) {
  setsockopt(socket.id(), level, name, &value, sizeof value);
}

void configure(const Descriptor& socket) {
  constexpr int kPatience_ms = 60'000, kQuiet_s = 30, kProbe_s = 10, kUnsent_B = 1;
  set_option(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, kUnsent_B);
  set_option(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, kPatience_ms);
  set_option(socket, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(socket, IPPROTO_TCP, TCP_KEEPIDLE, kQuiet_s);
  set_option(socket, IPPROTO_TCP, TCP_KEEPINTVL, kProbe_s);
}

}  // namespace

std::string error_text(int error) { return std::generic_category().message(error); }

Descriptor listen_at(const ListenAddress& address) {
  const std::string text = to_string(address);
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error =
          getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found))
    throw InputError("{}: {}", text, gai_strerror(error));
  const std::unique_ptr<addrinfo, FreeAddresses> list(found);

  Descriptor listener(socket(list->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (listener.id() < 0) throw Error("no socket for {}: {}", text, error_text(errno));
  set_option(listener, SOL_SOCKET, SO_REUSEADDR, 1);
  constexpr int kWaiting = 4;
  if (bind(listener.id(), list->ai_addr, list->ai_addrlen) != 0 || listen(listener.id(), kWaiting) != 0) {
    if (errno == EADDRINUSE)
      throw InputError("{}: the port is in use; end the program that listens there, or choose another", text);
    throw InputError("{}: {}", text, error_text(errno));
  }
  return listener;
}

std::uint16_t port_of(const Descriptor& listener) {
  sockaddr_storage address{};
  socklen_t size_B = sizeof address;
  getsockname(listener.id(), reinterpret_cast<sockaddr*>(&address), &size_B);
  std::uint16_t port = 0;
  address_text(address, size_B, &port);
  return port;
}

Accepted accept_at(const Descriptor& listener) {
  sockaddr_storage address{};
  socklen_t size_B = sizeof address;
  Descriptor socket(
      accept4(listener.id(), reinterpret_cast<sockaddr*>(&address), &size_B, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (socket.id() < 0) return {.socket = Descriptor(), .name = {}, .error = errno};
  configure(socket);
  return {.socket = std::move(socket), .name = address_text(address, size_B)};
}

}  // namespace xraycast
