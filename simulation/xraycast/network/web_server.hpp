#pragma once

#include "xraycast/network/listen_address.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// Serves one page over HTTP, and to those who have it open the newest state over a WebSocket, /live. It has
/// its own thread.
///
/// Only who knows the token is served, which is random and part of the address, and only under names that are
/// this server's: a page of another origin cannot connect, nor one whose name was made to lead here (DNS
/// rebinding). What comes in is bounded: headers, messages, connections, and the time that each may take. Who
/// has not shown the token takes no place from those who have.
/// Nothing queues: a browser that reads slowly gets the newest state when it has read the one before.
///
/// One browser steers, the one that has been connected for the longest; the next one does when it leaves. The
/// others' messages are passed over.
class WebServer {
 public:
  struct Options {
    ListenAddress address{.host = "127.0.0.1", .port = 0};
    std::vector<std::string> hosts{};  ///< more names that browsers know it by, NAME or NAME:PORT
  };

  /// Called on the server's thread.
  struct Events {
    /// A text message of the browser that steers; false: it is malformed, which is logged.
    std::function<bool(std::string_view text)> steer;
    std::function<void()> let_go;  ///< that browser has left
    std::function<void(const std::string& line)> log;
  };

  static constexpr std::size_t kMostBrowsers = 8;

  /// Throws InputError for a host that browsers cannot have in an address.
  static void check(const Options& options);

  /// Listens from construction on. Throws InputError where the address is not this machine's or the port is
  /// in use.
  WebServer(const Options& options, std::string page, Events events);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// Where the page is, with the token.
  std::string page_address() const;
  std::uint16_t port() const;

  /// How many have the page open.
  std::size_t browsers() const;

  /// How many had it open at once at most.
  std::size_t most_browsers() const;

  /// Throws what ended the server's thread.
  void check() const;

  /// Tells all browsers, as a binary message, also those that come later unless all have left meanwhile. Does
  /// not wait for them.
  void publish(std::string state);

  /// Tells all browsers, also those that come later, with who steers: JSON that the text message {"steers",
  /// "browsers"} has as "exercise" from now on.
  void tell(std::string exercise);

 private:
  class Server;
  class Visit;
  class Browser;

  std::unique_ptr<Server> server_;
};

}  // namespace xraycast
