#pragma once

#include "xraycast/network/igtlink_client.hpp"
#include "xraycast/network/rate_limited_log.hpp"
#include "xraycast/network/tcp_listener.hpp"
#include "xraycast/simulation/triple_buffer.hpp"

#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace xraycast {

/// What passes between the server's thread, the simulation's, which never waits, and the session's.
struct IgtlinkExchange {
  std::array<TripleBuffer<SentPose>, kMaxHubs> poses;     ///< from the server's thread to the simulation's
  std::array<TripleBuffer<HubLoad>, kMaxHubs> loads;      ///< from the simulation's thread to the server's
  std::array<TripleBuffer<HubOffset>, kMaxHubs> offsets;  ///< the same way

  TripleBuffer<IgtlinkCommands> commands;                   ///< from the server's thread to the session's
  std::array<std::atomic<bool>, kIgtlinkStreams> wanted{};  ///< the same way
  std::atomic<std::uint64_t> clients{0}, most_at_once{0}, images_sent{0};
};

/// Serves OpenIGTLink clients on its own thread: one that moves the hubs, and others that watch or command
/// the rest. Nothing queues: of what a client does not read in time it misses everything but the newest.
class IgtlinkServer {
 public:
  /// More are turned away, unless one of these is idle: for two seconds it has sent no pose, no command and
  /// no request for a stream, watches none and holds neither pedal nor injector. All but one may watch, and
  /// the client that moves the hubs.
  static constexpr std::size_t kMostClients = 8;

  /// Serves from construction on. With no hubs none can be moved. Throws as TcpListener.
  IgtlinkServer(const ListenAddress& address, std::size_t hubs, IgtlinkWatching watching,
                RateLimitedLog::Sink log);

  // For other threads.
  IgtlinkExchange exchange;
  const ListenAddress& address() const { return address_; }  ///< with the port that it has
  std::string status() const;

  /// The newest messages of a stream, for all that ask for them; null for none any more.
  void publish(IgtlinkStream stream, IgtlinkClient::Bytes messages);

  /// Throws what ended its thread.
  void check() const { thread_.check(); }

 private:
  using Clock = IgtlinkClient::Clock;
  using Bytes = IgtlinkClient::Bytes;
  using ClientPointer = std::shared_ptr<IgtlinkClient>;
  struct Published {
    Bytes bytes;
    std::uint64_t number = 0;
  };

  void run();

  // ---- connections
  Clock::duration patience() const;
  void admit(tcp::socket socket, const std::string& name);
  bool has_room();
  bool may_watch(const IgtlinkClient& client) const;
  void remove_ended();

  // ---- what they send
  void listen_to(const ClientPointer& client);
  bool receive(IgtlinkClient& client);
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

  boost::asio::io_context io_{1};
  std::size_t hubs_;
  IgtlinkWatching watching_;
  RateLimitedLog log_;
  TcpListener listener_;
  ListenAddress address_;
  std::vector<ClientPointer> clients_;  ///< in the order of their coming
  IgtlinkClient* mover_ = nullptr;      ///< the one that moves the hubs
  std::uint64_t movers_ = 0;            ///< so far
  std::array<SentPose, kMaxHubs> newest_;
  IgtlinkCommands commands_;
  std::array<Published, kIgtlinkStreams> published_;
  Clock::time_point now_ = Clock::now(), rate_since_ = now_;
  mutable std::mutex mutex_;  ///< of the next two; never taken by the simulation's thread
  std::array<Published, kIgtlinkStreams> coming_;
  std::string status_ = "no client";
  ServerThread thread_;  ///< last: it uses what is above
};

}  // namespace xraycast
