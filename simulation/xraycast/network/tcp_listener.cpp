#include "xraycast/network/tcp_listener.hpp"

#include "xraycast/base/error.hpp"

#include <chrono>
#include <fcntl.h>
#include <utility>

namespace xraycast {
namespace {

// Connections that wait to be accepted.
constexpr int kWaiting = 32;
// Until the next connection is accepted, where the system had no resources for one.
constexpr std::chrono::seconds kFull{1};

/// Programs that are started meanwhile, as OpenCL's linker, do not inherit it.
void keep_from_children(auto& socket) { fcntl(socket.native_handle(), F_SETFD, FD_CLOEXEC); }

}  // namespace

std::string to_string(const tcp::endpoint& endpoint) {
  return to_string(ListenAddress{endpoint.address().to_string(), endpoint.port()});
}

TcpListener::TcpListener(boost::asio::io_context& io, const ListenAddress& address, RateLimitedLog& log,
                         Welcome welcome)
    : acceptor_(io), pause_(io), log_(log), welcome_(std::move(welcome)) {
  const std::string text = to_string(address);
  error_code error;
  const auto found =
      tcp::resolver(io).resolve(address.host, std::to_string(address.port),
                                tcp::resolver::passive | tcp::resolver::numeric_service, error);
  if (error) throw InputError("{}: {}", text, error.message());
  const tcp::endpoint endpoint = found.begin()->endpoint();
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(kWaiting, error);
  if (error == boost::asio::error::address_in_use)
    throw InputError("{}: the port is in use; end the program that listens there, or choose another", text);
  if (error) throw InputError("{}: {}", text, error.message());
  keep_from_children(acceptor_);
  endpoint_ = acceptor_.local_endpoint();
}

void TcpListener::accept() {
  acceptor_.async_accept(peer_, [this](error_code error, tcp::socket socket) {
    if (error == boost::asio::error::operation_aborted) return;
    if (error) {
      log_.add("accept", fmt::format("a connection could not be accepted: {}", error.message()),
               RateLimitedLog::Clock::now());
      pause_.expires_after(kFull);
      return pause_.async_wait([this](error_code) { accept(); });
    }
    keep_from_children(socket);
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    welcome_(std::move(socket), to_string(peer_));
    accept();
  });
}

ServerThread::ServerThread(boost::asio::io_context& io, std::function<void()> run)
    : io_(io), thread_([this, run = std::move(run)] {
        try {
          run();
        } catch (...) {
          failure_ = std::current_exception();
          failed_ = true;
        }
      }) {}

ServerThread::~ServerThread() {
  io_.stop();
  thread_.join();
}

void ServerThread::check() const {
  if (failed_) std::rethrow_exception(failure_);
}

}  // namespace xraycast
