#pragma once

#include "xraycast/haptics/igtlink_client.hpp"
#include "xraycast/haptics/igtlink_exchange.hpp"
#include "xraycast/haptics/igtlink_messages.hpp"
#include "xraycast/haptics/rate_limited_log.hpp"
#include "xraycast/haptics/tcp_listener.hpp"

#include <array>
#include <atomic>
#include <list>
#include <mutex>
#include <string>
#include <vector>

struct pollfd;

namespace xraycast {

/// Serves OpenIGTLink clients on its own thread: one that moves the hubs, and others that watch or command
/// the rest. Nothing queues: of what a client does not read in time it misses everything but the newest.
class IgtlinkServer {
 public:
  /// More are turned away, unless one of these is idle: for two seconds it has sent no pose, no command and
  /// no request for a stream, watches none and holds neither pedal nor injector. All but one may watch, and
  /// the client that moves the hubs.
  static constexpr std::size_t kMostClients = 8;

  /// `address` is where `listener` listens, for the log. With no hubs none can be moved. The exchange must
  /// outlive it.
  IgtlinkServer(Descriptor listener, std::string address, std::size_t hubs, IgtlinkWatching watching,
                IgtlinkExchange& exchange, RateLimitedLog::Sink log);

  /// Returns after `stop`.
  void run();

  // For other threads.
  void stop();
  void wake();  ///< there is something new to send
  std::string status() const;

 private:
  using Clock = IgtlinkClient::Clock;
  using Bytes = IgtlinkClient::Bytes;

  // ---- connections
  std::vector<pollfd> wait();
  Clock::duration patience() const;
  void admit();
  void reject(const Accepted& accepted);
  bool has_room();
  bool may_watch(const IgtlinkClient& client) const;
  void remove_ended();

  // ---- what they send
  void receive(IgtlinkClient& client);
  void drain(IgtlinkClient& client);
  void handle(IgtlinkClient& client, const IgtlinkReceiver::Event& event);
  void move_hub(IgtlinkClient& client, const HubMove& move);
  bool takes_hub(IgtlinkClient& client);
  void obey(IgtlinkClient& client, const IgtlinkReceiver::Event& event);
  void start_or_stop(IgtlinkClient& client, const StreamRequest& request);
  void release_silent();
  void publish_commands();
  void publish_wishes();

  // ---- what they receive
  void take_published();
  void load_is_due(IgtlinkClient& client, std::size_t hub);
  void send_due(IgtlinkClient& client);
  Bytes next_message(IgtlinkClient& client);
  Bytes next_of_streams(IgtlinkClient& client);
  std::string text_of_poses();

  void say(const IgtlinkClient& client, std::string_view topic, const std::string& what) {
    log_.add(topic, client.name() + " " + what, now_);
  }
  void count_rate();
  void set_status(const std::string& text);

  Descriptor listener_, waker_;
  std::string address_;
  std::size_t hubs_;
  IgtlinkWatching watching_;
  IgtlinkExchange& exchange_;
  RateLimitedLog log_;
  IgtlinkMessages messages_;
  std::list<IgtlinkClient> clients_;
  IgtlinkClient* mover_ = nullptr;  ///< the one that moves the hubs
  std::uint64_t movers_ = 0;        ///< so far
  std::array<HandPose, kMaxHubs> newest_;
  IgtlinkCommands commands_;
  std::array<IgtlinkExchange::Published, kIgtlinkStreams> published_;
  Clock::time_point now_ = Clock::now(), rate_since_ = now_, full_until_ = now_;
  std::atomic<bool> stops_{false};
  mutable std::mutex mutex_;  ///< of `status_`; never taken by the simulation's thread
  std::string status_;
};

}  // namespace xraycast
