#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/listen_address.hpp"
#include "xraycast/simulation/triple_buffer.hpp"

#include <atomic>
#include <exception>
#include <functional>
#include <memory>
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

  /// Listens from construction on. Throws InputError where the address is not this machine's or the port is
  /// in use.
  IgtlinkDevice(const ListenAddress& address, Log log);
  ~IgtlinkDevice() override;

  HandPose pose() override {
    if (failed_) std::rethrow_exception(failure_);
    return poses_.read();
  }
  void feel(const HubLoad& load) override { loads_.write(load); }
  std::string status() const override;

  /// Where it listens, with the port chosen by the system if 0 was given.
  const ListenAddress& address() const { return address_; }

 private:
  class Server;

  void serve();

  TripleBuffer<HandPose> poses_;  ///< from the server's thread to the simulation's
  TripleBuffer<HubLoad> loads_;   ///< from the simulation's thread to the server's
  ListenAddress address_;
  std::unique_ptr<Server> server_;
  std::exception_ptr failure_;  ///< of the server's thread; written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
