#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/hub_name.hpp"
#include "xraycast/haptics/igtlink_session.hpp"
#include "xraycast/haptics/listen_address.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

namespace xraycast {

class IgtlinkServer;
struct IgtlinkExchange;

/// A haptic device connected by OpenIGTLink over TCP: it sends TRANSFORM, and receives a SENSOR of force and
/// one of torque for each, at its own rate, or every 20 ms while it is silent. Of a session that may be
/// watched, clients also receive pictures, shapes and tips, and command C-arm, pedal and contrast agent;
/// docs/haptics.md has the protocol.
///
/// Its server has its own thread. One client moves the hubs; another one that tries receives STATUS (busy)
/// and is rejected, unless the first has sent no pose for two seconds, as after a cable was pulled. Nothing
/// queues: what a client does not read in time is dropped, and its excess messages wait in its own socket.
class IgtlinkDevice final : public HapticDevice {
 public:
  /// Receives one line at a time, on the server's thread: connections and invalid messages.
  using Log = std::function<void(const std::string& line)>;

  /// Listens from construction on, to poses of `hubs` devices, up to kMaxHubs; with none no client may move
  /// one. Throws InputError where the address is not this machine's or the port is in use.
  IgtlinkDevice(const ListenAddress& address, Log log, std::size_t hubs = 1, IgtlinkWatching watching = {});
  ~IgtlinkDevice() override;

  HandPose pose(std::size_t hub) override;
  void feel(std::size_t hub, const HubLoad& load) override;
  void go_on_from(std::size_t hub, const HubPose& pose) override;
  std::string status() const override;

  /// Where it listens, with the port chosen by the system if 0 was given.
  const ListenAddress& address() const { return address_; }

  // ---- for the one other thread of a session that may be watched
  /// What its clients command, valid until the next call. Throws what ended the server's thread.
  const IgtlinkCommands& commands();

  /// Whether a client waits for a stream's messages.
  bool wanted(IgtlinkStream stream) const;

  /// The newest messages of a stream, packed once for all (igtlink_frames.hpp), instead of those before.
  void publish(IgtlinkStream stream, std::string messages);

  /// What was published is too old for clients that ask from now on.
  void withdraw(IgtlinkStream stream);

  IgtlinkCounts counts() const;

 private:
  /// Of a hub from what the client that moves it sends.
  struct Offset {
    HubPose by;
    std::uint64_t client = 0;
  };

  void serve();
  void set_offset(std::size_t hub, const Offset& offset);

  std::unique_ptr<IgtlinkExchange> exchange_;
  std::array<HandPose, kMaxHubs> hands_;  ///< as they were last read
  std::array<std::uint64_t, kMaxHubs> hand_clients_{};
  std::array<Offset, kMaxHubs> offsets_;
  std::array<std::optional<HubPose>, kMaxHubs> waits_at_;  ///< from where the first pose goes on
  ListenAddress address_;
  std::unique_ptr<IgtlinkServer> server_;
  std::exception_ptr failure_;  ///< of the server's thread; written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
