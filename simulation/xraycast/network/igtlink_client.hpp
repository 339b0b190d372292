#pragma once

#include "xraycast/network/igtlink_receiver.hpp"
#include "xraycast/network/tcp_listener.hpp"

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace xraycast {

/// A connection of the OpenIGTLink server: what it has sent, what it waits for, and the one message that is
/// on its way to it. Nothing queues in the kernel but what the peer's window takes: what a slow reader misses
/// is dropped before it is sent. It ends when the peer does not answer, or does not read, for a minute.
class IgtlinkClient : public std::enable_shared_from_this<IgtlinkClient> {
 public:
  using Clock = std::chrono::steady_clock;
  using Bytes = std::shared_ptr<const std::string>;

  IgtlinkClient(tcp::socket socket, std::string name, std::size_t hubs,
                const IgtlinkReceiver::Rotations& rotations_rad, bool is_session, Clock::time_point now);
  IgtlinkClient(const IgtlinkClient&) = delete;
  IgtlinkClient& operator=(const IgtlinkClient&) = delete;

  const std::string& name() const { return name_; }

  /// Calls `then` once there is something to read; not after its end.
  void wait_to_read(std::function<void()> then);

  /// Wakes who runs the connections once it takes more.
  void wait_to_send();

  // ---- what it does
  // The last hub pose; the last pose, command or request for a stream; the last message. At first, when it
  // connected.
  Clock::time_point last_pose, last_use, last_message;
  bool is_pressing = false;  ///< the pedal
  double injection_ml_s = 0;
  bool is_holding() const { return is_pressing || injection_ml_s > 0; }
  std::uint64_t poses = 0;  ///< since the last count

  // ---- what it waits for
  bool status_due = true;                                ///< also on connecting
  std::array<bool, kMaxHubs> loads_due{};                ///< serialised once they can be sent
  std::array<Clock::time_point, kMaxHubs> loads_told{};  ///< when a load was last due
  std::string answers;                                   ///< RTS_
  struct Stream {
    bool is_started = false;  ///< it asked for it
    bool is_unasked = false;  ///< it receives it without asking
    bool is_asked_once = false;
    Clock::duration interval{0};
    Clock::time_point next{};  ///< not before
    std::uint64_t sent = 0;    ///< the number of the last message
    bool is_on() const { return is_started || is_unasked; }

    /// Whether a message needs to be made now, so that it can be sent in time.
    bool is_wanted(Clock::time_point now) const { return is_asked_once || (is_on() && now + kLead >= next); }
    static constexpr std::chrono::milliseconds kLead{40};  ///< a frame, at 25 a second and more
  };
  std::array<Stream, kIgtlinkStreams> streams{};
  bool watches() const;  ///< has started a stream

  /// Reads a portion; false when nothing more is waiting, or it has ended.
  using Handler = std::function<void(const IgtlinkReceiver::Event& event)>;
  bool receive(const Handler& handle);

  /// Sends what `next` gives, which is null for nothing, until the connection takes no more.
  void send(const std::function<Bytes()>& next);
  bool is_sending() const { return sending_ != nullptr; }

  /// It has not read for a second: nothing new needs to be made for it.
  bool is_stuck(Clock::time_point now) const { return sending_ && now - sent_at_ > std::chrono::seconds(1); }

  /// A last message, if it can be sent at once, and the end.
  void end(const std::string& message, std::string_view topic, std::string why);
  void end(std::string_view topic, std::string why) { end("", topic, std::move(why)); }

  /// Why it has ended, for the log.
  struct End {
    std::string_view topic;  ///< a string literal
    std::string why;
  };
  const std::optional<End>& ended() const { return ended_; }

 private:
  bool has_failed(error_code error);

  tcp::socket socket_;
  std::string name_;
  IgtlinkReceiver receiver_;
  Bytes sending_;
  std::size_t sent_B_ = 0;
  bool waits_to_send_ = false;
  Clock::time_point sent_at_{};  ///< when the connection last took something
  std::optional<End> ended_;
};

}  // namespace xraycast
