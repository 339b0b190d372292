#pragma once

#include "xraycast/haptics/listen_address.hpp"

#include <cstdint>
#include <string>
#include <unistd.h>
#include <utility>

namespace xraycast {

/// A file descriptor, closed at its end.
class Descriptor {
 public:
  explicit Descriptor(int id = -1) : id_(id) {}
  ~Descriptor() {
    if (id_ >= 0) close(id_);
  }
  Descriptor(Descriptor&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  int id() const { return id_; }

 private:
  int id_;
};

/// What errno says, in words.
std::string error_text(int error);

/// A socket that listens, without blocking. Throws InputError where the address is not this machine's or the
/// port is in use.
Descriptor listen_at(const ListenAddress& address);

/// The port at which it listens.
std::uint16_t port_of(const Descriptor& listener);

struct Accepted {
  Descriptor socket;  ///< none where `error` is set
  std::string name;   ///< the peer's address
  int error = 0;
};

/// The next connection that waits. Its socket does not block, sends at once, and lets nothing queue in the
/// kernel but what its peer's window takes: what a slow reader misses is dropped before it is sent. It ends
/// when the peer does not answer, or does not read, for a minute.
Accepted accept_at(const Descriptor& listener);

}  // namespace xraycast
