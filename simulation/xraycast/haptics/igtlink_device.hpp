#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/network/igtlink_session.hpp"
#include "xraycast/network/listen_address.hpp"

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace xraycast {

class IgtlinkServer;

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

  /// Listens from construction on, to poses of `hubs` instruments, up to kMaxHubs; with none no client may
  /// move one. Throws InputError where the address is not this machine's or the port is in use.
  IgtlinkDevice(const ListenAddress& address, Log log, std::size_t hubs = 1, IgtlinkWatching watching = {});
  ~IgtlinkDevice() override;

  HandPose pose(std::size_t hub) override;
  void set_load(std::size_t hub, const HubLoad& load) override;
  void go_on_from(std::size_t hub, const HubPose& pose) override;
  std::string status() const override;

  /// Where it listens, with the port chosen by the system if 0 was given.
  const ListenAddress& address() const;

  // ---- for the one other thread of a session that may be watched
  /// What its clients command, valid until the next call. Throws what ended the server's thread.
  const IgtlinkCommands& commands();

  /// Whether a client waits for a stream's messages.
  bool wanted(IgtlinkStream stream) const;

  /// The newest messages of a stream, packed once for all (igtlink_messages.hpp), instead of those before.
  void publish(IgtlinkStream stream, std::string messages);

  /// What was published is too old for clients that ask from now on.
  void withdraw(IgtlinkStream stream);

  IgtlinkCounts counts() const;

 private:
  void set_offset(std::size_t hub, const HubOffset& offset);

  std::array<SentPose, kMaxHubs> hands_;  ///< as they were last read
  std::array<HubOffset, kMaxHubs> offsets_;
  std::array<std::optional<HubPose>, kMaxHubs> waits_at_;  ///< from where the first pose goes on
  std::unique_ptr<IgtlinkServer> server_;
};

}  // namespace xraycast
