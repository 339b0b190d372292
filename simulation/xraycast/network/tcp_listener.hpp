#pragma once

#include "xraycast/network/listen_address.hpp"
#include "xraycast/network/rate_limited_log.hpp"

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <exception>
#include <functional>
#include <string>
#include <thread>

namespace xraycast {

using boost::asio::ip::tcp;
using boost::system::error_code;

/// Accepts connections, on the thread that runs `io`. Where the system has no resources for one, the log says
/// so and the next is accepted a second later.
class TcpListener {
 public:
  /// Takes a connection, which sends at once, and the peer's address.
  using Welcome = std::function<void(tcp::socket socket, const std::string& name)>;

  /// Listens from construction on. Throws InputError where the address is not this machine's or the port is
  /// in use.
  TcpListener(boost::asio::io_context& io, const ListenAddress& address, RateLimitedLog& log,
              Welcome welcome);

  /// The port is the system's choice where 0 was asked for.
  const tcp::endpoint& endpoint() const { return endpoint_; }

  /// Accepts all connections from now on.
  void accept();

 private:
  tcp::acceptor acceptor_;
  boost::asio::steady_timer pause_;
  RateLimitedLog& log_;
  Welcome welcome_;
  tcp::endpoint endpoint_;
  tcp::endpoint peer_;  ///< of the connection that is accepted next
};

/// As a ListenAddress is written.
std::string to_string(const tcp::endpoint& endpoint);

/// A server's own thread, which runs its connections until the end.
class ServerThread {
 public:
  /// `run` returns when `io` is stopped.
  ServerThread(boost::asio::io_context& io, std::function<void()> run);
  ~ServerThread();
  ServerThread(const ServerThread&) = delete;
  ServerThread& operator=(const ServerThread&) = delete;

  /// Throws what ended it, on any other thread.
  void check() const;

 private:
  boost::asio::io_context& io_;
  std::exception_ptr failure_;  ///< written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
