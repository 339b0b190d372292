#pragma once

#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <functional>
#include <netinet/in.h>
#include <string>
#include <sys/socket.h>
#include <sys/time.h>
#include <thread>
#include <unistd.h>

namespace xraycast {

/// A connection to the server. Throws where what it waits for does not come, nor the end.
class WebTestSocket {
 public:
  explicit WebTestSocket(std::uint16_t port, int receive_buffer_B = 0)
      : id_(socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer_B > 0)
      setsockopt(id_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_B, sizeof receive_buffer_B);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(id_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(id_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw Error("no connection to port {}", port);
  }
  ~WebTestSocket() { close(id_); }
  WebTestSocket(const WebTestSocket&) = delete;
  WebTestSocket& operator=(const WebTestSocket&) = delete;

  void send(const std::string& bytes) const { ::send(id_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }

  /// So many bytes, or those before the end.
  std::string receive(std::size_t count) {
    while (unread_.size() < count && receive_some()) {
    }
    return take(std::min(count, unread_.size()));
  }

  /// All up to and with `end`, or until the connection ends.
  std::string receive_to(const std::string& end) {
    while (unread_.find(end) == std::string::npos)
      if (!receive_some()) return take(unread_.size());
    return take(unread_.find(end) + end.size());
  }

  std::string receive_all() {
    while (receive_some()) {
    }
    return take(unread_.size());
  }

 private:
  bool receive_some() {
    std::array<char, 65536> buffer;
    const ssize_t size_B = recv(id_, buffer.data(), buffer.size(), 0);
    if (size_B < 0 && errno == EAGAIN) throw Error("the server neither sends nor closes");
    if (size_B > 0) unread_.append(buffer.data(), static_cast<std::size_t>(size_B));
    return size_B > 0;
  }
  std::string take(std::size_t count) {
    std::string bytes = unread_.substr(0, count);
    unread_.erase(0, count);
    return bytes;
  }

  int id_;
  std::string unread_;
};

struct WebTestFrame {
  int kind = 0;  ///< 1 text, 2 binary, 8 close; 0: the connection has ended
  std::string payload;
};

/// Of http://127.0.0.1:PORT/.
inline std::uint16_t port_of(const std::string& page_address) {
  return static_cast<std::uint16_t>(std::stoi(page_address.substr(page_address.rfind(':') + 1)));
}

/// A browser with the page open.
class WebTestTab {
 public:
  explicit WebTestTab(const std::string& page_address, int receive_buffer_B = 0)
      : socket_(port_of(page_address), receive_buffer_B) {
    socket_.send(fmt::format(
        "GET /live{} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
        page_address.substr(page_address.find('?')), port_of(page_address)));
    answer_ = socket_.receive_to("\r\n\r\n");
  }

  const std::string& answer() const { return answer_; }

  WebTestFrame receive() {
    const std::string head = socket_.receive(2);
    if (head.size() < 2) return {};
    std::uint64_t size_B = static_cast<unsigned char>(head[1]) & 127;
    if (size_B >= 126) {
      const std::string longer = socket_.receive(size_B == 126 ? 2 : 8);
      size_B = 0;
      for (const char byte : longer) size_B = size_B << 8 | static_cast<unsigned char>(byte);
    }
    return {static_cast<unsigned char>(head[0]) & 15, socket_.receive(size_B)};
  }

  /// Masked by zeros.
  void send(const std::string& payload, int kind = 1) const {
    std::string frame{static_cast<char>(128 | kind)};
    if (payload.size() < 126) {
      frame += static_cast<char>(128 | payload.size());
    } else {
      frame += static_cast<char>(128 | 126);
      frame += static_cast<char>(payload.size() >> 8);
      frame += static_cast<char>(payload.size() & 255);
    }
    socket_.send(frame + std::string(4, '\0') + payload);
  }

 private:
  WebTestSocket socket_;
  std::string answer_;
};

inline void wait_until(const std::function<bool()>& is_so) {
  for (int i = 0; i < 500 && !is_so(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_TRUE(is_so());
}

}  // namespace xraycast
