#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/projection/view.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// A hub's pose as a client sent it.
struct SentPose {
  HubPose pose;
  std::uint64_t count = 0;   ///< of this hub's so far
  std::uint64_t client = 0;  ///< which of those that moved the hubs, from 1
};

/// Of a hub from what that client sends.
struct HubOffset {
  HubPose by;
  std::uint64_t client = 0;
};

/// What a client asks for with GET_, STT_ and STP_: pictures (IMAGE), the run's report (STRING), the
/// instruments' shapes (POINT) and their tips (TRANSFORM).
enum class IgtlinkStream { image, text, point, transform };
inline constexpr std::size_t kIgtlinkStreams = 4;

/// Whether clients may watch a session.
struct IgtlinkWatching {
  bool is_allowed = false;
  bool is_unasked = false;  ///< every client receives all streams without asking
};

/// What a client last ordered, and how often one did.
struct IgtlinkOrder {
  double value = 0;
  std::uint64_t orders = 0;
};

/// What all clients of a session command, besides the hubs.
struct IgtlinkCommands {
  bool pedal = false;         ///< down for any of them
  double injection_ml_s = 0;  ///< the greatest
  View c_arm;  ///< the newest that a TRANSFORM `CArm` asked for: its angles, and the isocentre as its centre
  std::uint64_t c_arm_moves = 0;
  /// One a hub: to which pressure its balloon is to be filled, in bar, and how far its sheath drawn back, in
  /// mm.
  std::array<IgtlinkOrder, kMaxHubs> balloons_bar{}, sheaths_mm{};
  std::array<std::uint64_t, kMaxHubs> detachments{};  ///< one a hub: of coils, so far
  IgtlinkOrder particles_mm{};                        ///< the diameter of those in the agent
  static constexpr std::size_t kKeptTexts = 16;
  std::vector<std::string> body;  ///< the last of what STRINGs `Body` asked for, oldest first
  std::uint64_t body_texts = 0;   ///< so far
};

/// Of clients so far.
struct IgtlinkCounts {
  std::uint64_t clients = 0, most_at_once = 0, images_sent = 0;
};

}  // namespace xraycast
