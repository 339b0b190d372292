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

/// A haptic device that speaks OpenIGTLink over TCP: it sends TRANSFORM, and is sent a SENSOR of force and
/// one of torque for each, at its own rate, or every 20 ms while it is silent; docs/haptics.md has the
/// protocol.
///
/// It is served by a thread of its own. One client at a time: another is sent STATUS (busy) and turned away,
/// unless the first has sent no pose for two seconds, as after a cable was pulled, or when it only looks on.
/// Nothing queues: loads that a client does not read in time are left out, and what it sends in excess waits
/// in its own socket.
class IgtlinkDevice final : public HapticDevice {
 public:
  /// Receives one line at a time, on the server's thread: who comes and goes, what is wrong with what was
  /// sent.
  using Log = std::function<void(const std::string& line)>;

  /// Listens from here on. Throws InputError where the address is not this machine's or the port is in use.
  IgtlinkDevice(const ListenAddress& address, Log log);
  ~IgtlinkDevice() override;

  HandPose pose() override {
    if (failed_) std::rethrow_exception(failure_);
    return poses_.read();
  }
  void feel(const HubLoad& load) override { loads_.write(load); }
  std::string status() const override;

  /// Where it listens, with the port that was free if it was to be any.
  const ListenAddress& address() const { return address_; }

 private:
  class Server;

  void serve();

  TripleBuffer<HandPose> poses_;  ///< from the server's thread to the simulation's
  TripleBuffer<HubLoad> loads_;   ///< and back
  ListenAddress address_;
  std::unique_ptr<Server> server_;
  std::exception_ptr failure_;  ///< of the server's thread; written before `failed_` is set
  std::atomic<bool> failed_{false};
  std::thread thread_;
};

}  // namespace xraycast
