#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/hub_name.hpp"
#include "xraycast/haptics/igtlink_session.hpp"
#include "xraycast/simulation/triple_buffer.hpp"

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

namespace xraycast {

/// What passes between the server's thread, the simulation's, which never waits, and the session's.
struct IgtlinkExchange {
  /// A pose, and which of the clients that moved the hubs sent it, from 1.
  struct Sent {
    HandPose hand;
    std::uint64_t client = 0;
  };
  /// Of a hub from what that client sends.
  struct Offset {
    HubPose by;
    std::uint64_t client = 0;
  };
  std::array<TripleBuffer<Sent>, kMaxHubs> poses;      ///< from the server's thread to the simulation's
  std::array<TripleBuffer<HubLoad>, kMaxHubs> loads;   ///< from the simulation's thread to the server's
  std::array<TripleBuffer<Offset>, kMaxHubs> offsets;  ///< the same way

  TripleBuffer<IgtlinkCommands> commands;                   ///< from the server's thread to the session's
  std::array<std::atomic<bool>, kIgtlinkStreams> wanted{};  ///< the same way
  std::atomic<std::uint64_t> clients{0}, most_at_once{0}, images_sent{0};

  /// The newest messages of a stream, for all that ask for them.
  struct Published {
    std::shared_ptr<const std::string> bytes;
    std::uint64_t number = 0;
  };
  std::mutex mutex;  ///< of `published`; never taken by the simulation's thread
  std::array<Published, kIgtlinkStreams> published;
};

}  // namespace xraycast
