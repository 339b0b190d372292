#include "xraycast/haptics/igtlink_client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <sys/socket.h>

namespace xraycast {
namespace {

// Bytes read at a time.
constexpr int kPortion_B = 16384;

}  // namespace

bool IgtlinkClient::watches() const { return std::ranges::any_of(streams, &Stream::is_started); }

bool IgtlinkClient::receive(const Handler& handle) {
  if (ended_) return false;
  std::array<std::byte, kPortion_B> buffer;
  const ssize_t size_B = recv(socket_.id(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (size_B < 0) {
    if (errno != EAGAIN && errno != EINTR)
      end("lost", fmt::format("was disconnected: {}", error_text(errno)));
    return false;
  }
  if (size_B == 0) {
    if (const auto complaint = receiver_.end()) handle(*complaint);
    end("gone", "has disconnected");
    return false;
  }
  std::span<const std::byte> bytes = std::span(buffer).first(static_cast<std::size_t>(size_B));
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
    const ssize_t size_B = ::send(socket_.id(), sending_->data() + sent_B_, sending_->size() - sent_B_,
                                  MSG_NOSIGNAL | MSG_DONTWAIT);
    if (size_B < 0) {
      if (errno != EAGAIN && errno != EINTR)
        end("lost", fmt::format("was disconnected: {}", error_text(errno)));
      return;
    }
    sent_B_ += static_cast<std::size_t>(size_B);
    sent_at_ = Clock::now();
    if (sent_B_ == sending_->size()) sending_.reset();
  }
}

void IgtlinkClient::end(const std::string& message, std::string_view topic, std::string why) {
  if (ended_) return;
  if (!message.empty() && !sending_)
    ::send(socket_.id(), message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  sending_.reset();
  ended_ = End{topic, std::move(why)};
}

}  // namespace xraycast
