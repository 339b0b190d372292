#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/hub_name.hpp"
#include "xraycast/haptics/listen_address.hpp"
#include "xraycast/simulation/triple_buffer.hpp"

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

/// A haptic device connected by OpenIGTLink over TCP: it sends TRANSFORM, and receives a SENSOR of force and
/// one of torque for each, at its own rate, or every 20 ms while it is silent; docs/haptics.md has the
/// protocol.
///
/// Its server has its own thread. One client at a time: another one receives STATUS (busy) and is rejected,
/// unless the first has sent no pose for two seconds, as after a cable was pulled, or when it only watches.
/// Nothing queues: loads that a client does not read in time are dropped, and its excess messages wait in its
/// own socket.
class IgtlinkDevice final : public HapticDevice {
 public:
  /// Receives one line at a time, on the server's thread: connections and invalid messages.
  using Log = std::function<void(const std::string& line)>;

  /// Listens from construction on, to poses of `hubs` devices, 1 to kMaxHubs. Throws InputError where the
  /// address is not this machine's or the port is in use.
  IgtlinkDevice(const ListenAddress& address, Log log, std::size_t hubs = 1);
  ~IgtlinkDevice() override;

  HandPose pose(std::size_t hub) override;
  void feel(std::size_t hub, const HubLoad& load) override { loads_[hub].write(load); }
  void go_on_from(std::size_t hub, const HubPose& pose) override;
  std::string status() const override;

  /// Where it listens, with the port chosen by the system if 0 was given.
  const ListenAddress& address() const { return address_; }

 private:
  class Server;
  /// A pose, and which of the clients sent it, from 1.
  struct Sent {
    HandPose hand;
    std::uint64_t client = 0;
  };
  /// Of a hub from what that client sends.
  struct Offset {
    HubPose by;
    std::uint64_t client = 0;
  };

  void serve();
  void set_offset(std::size_t hub, const Offset& offset);

  std::array<TripleBuffer<Sent>, kMaxHubs> poses_;           ///< from the server's thread to the simulation's
  std::array<TripleBuffer<HubLoad>, kMaxHubs> loads_;        ///< from the simulation's thread to the server's
  std::array<TripleBuffer<Offset>, kMaxHubs> told_offsets_;  ///< the same way
  std::array<Sent, kMaxHubs> sent_;                          ///< as they were last read
  std::array<Offset, kMaxHubs> offsets_;
  std::array<std::optional<HubPose>, kMaxHubs> waits_at_;  ///< from where the first pose goes on
  ListenAddress address_;
  std::unique_ptr<Server> server_;
  std::exception_ptr failure_;  ///< of the server's thread; written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
