#include "xraycast/network/igtlink_client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <netinet/tcp.h>
#include <utility>

namespace xraycast {
namespace {

namespace asio = boost::asio;

// Bytes read at a time.
constexpr int kPortion_B = 16384;

void configure(tcp::socket& socket) {
  const auto set = [id = socket.native_handle()](int level, int name, int value) {
    setsockopt(id, level, name, &value, sizeof value);
  };
  constexpr int kPatience_ms = 60'000, kQuiet_s = 30, kProbe_s = 10, kUnsent_B = 1;
  set(IPPROTO_TCP, TCP_NOTSENT_LOWAT, kUnsent_B);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, kPatience_ms);
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, kQuiet_s);
  set(IPPROTO_TCP, TCP_KEEPINTVL, kProbe_s);
  socket.non_blocking(true);
}

}  // namespace

IgtlinkClient::IgtlinkClient(tcp::socket socket, std::string name, std::size_t hubs,
                             const IgtlinkReceiver::Rotations& rotations_rad, bool is_session,
                             Clock::time_point now)
    : last_pose(now),
      last_use(now),
      last_message(now),
      socket_(std::move(socket)),
      name_(std::move(name)),
      receiver_(hubs, rotations_rad, is_session) {
  configure(socket_);
}

bool IgtlinkClient::watches() const { return std::ranges::any_of(streams, &Stream::is_started); }

void IgtlinkClient::wait_to_read(std::function<void()> then) {
  if (ended_) return;
  socket_.async_wait(tcp::socket::wait_read,
                     [self = shared_from_this(), then = std::move(then)](error_code error) {
                       if (!error && !self->ended_) then();
                     });
}

void IgtlinkClient::wait_to_send() {
  if (!sending_ || std::exchange(waits_to_send_, true)) return;
  socket_.async_wait(tcp::socket::wait_write,
                     [self = shared_from_this()](error_code) { self->waits_to_send_ = false; });
}

bool IgtlinkClient::receive(const Handler& handle) {
  if (ended_) return false;
  std::array<std::byte, kPortion_B> buffer;
  error_code error;
  const std::size_t size_B = socket_.read_some(asio::buffer(buffer), error);
  if (error == asio::error::eof) {
    if (const auto complaint = receiver_.end()) handle(*complaint);
    end("gone", "has disconnected");
    return false;
  }
  if (has_failed(error)) return false;
  std::span<const std::byte> bytes = std::span(buffer).first(size_B);
  while (!ended_) {
    const auto event = receiver_.next(bytes);
    if (!event) break;
    handle(*event);
  }
  if (receiver_.lost()) end("dropped", "was disconnected: the message framing is lost");
  return !ended_;
}

void IgtlinkClient::send(const std::function<Bytes()>& next) {
  while (!ended_) {
    if (!sending_) {
      sending_ = next();
      sent_B_ = 0;
      sent_at_ = Clock::now();
    }
    if (!sending_) return;
    error_code error;
    sent_B_ += socket_.send(asio::buffer(*sending_) + sent_B_, 0, error);
    if (has_failed(error)) return;
    sent_at_ = Clock::now();
    if (sent_B_ == sending_->size()) sending_.reset();
  }
}

bool IgtlinkClient::has_failed(error_code error) {
  if (error && error != asio::error::would_block) end("lost", "was disconnected: " + error.message());
  return error.failed();
}

void IgtlinkClient::end(const std::string& message, std::string_view topic, std::string why) {
  if (ended_) return;
  error_code ignored;
  if (!message.empty() && !sending_) socket_.send(asio::buffer(message), 0, ignored);
  socket_.close(ignored);
  sending_.reset();
  ended_ = End{topic, std::move(why)};
}

}  // namespace xraycast
