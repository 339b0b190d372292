#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/serving/intervention.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// The pose of C-arm and table that a client asks for. What is left open stays as it is.
struct CArmRequest {
  double lao_rad = 0;
  double cranial_rad = 0;
  std::optional<double> centre_z_mm{};  ///< height of the isocentre, by the table (LPS)
  std::optional<double> zoom{};
};

/// What the clients of an outlet command.
struct LiveCommands {
  bool pedal = false;
  double injection_ml_s = 0;
  /// Velocity of the hub that is held, where neither a haptic device nor a script moves it.
  double insertion_mm_s = 0, rotation_rad_s = 0;
  // Since the last call:
  std::optional<CArmRequest> c_arm{};
  int next_hubs = 0, valve_toggles = 0;  ///< how often each was asked for
  /// One a hub: to which pressure its balloon is to be filled, in bar, and how far its sheath drawn back.
  std::array<std::optional<double>, kMaxHubs> balloons_bar{}, sheaths_mm{};
  std::array<bool, kMaxHubs> detaches{};  ///< the coil on its wire
  std::optional<Particles> particles{};   ///< to be in the agent
  BodyChanges body{};
  std::vector<std::string> body_texts{};  ///< the same in words, in their order; see parse_body_changes
};

/// What is drawn for those who watch: one of the two holds width x height pixels, row 0 on top.
struct LivePicture {
  View view;
  std::vector<std::uint8_t> greys{};   ///< what a display shows
  std::vector<std::uint16_t> codes{};  ///< a detector's codes, or finer greys
};

/// The session after a frame.
struct LiveFrame {
  const Intervention& intervention;
  const CArmPose& c_arm;                 ///< where it is now; the picture was taken from intervention.pose()
  const LivePicture* picture = nullptr;  ///< null where this frame drew none
  /// The last picture is older than the last exposure, or pulse: nobody waited for pictures then.
  bool is_outdated = false;
  LiveBody* body = nullptr;  ///< that moves; null: it is still
};

/// Whatever publishes a session to its clients and takes their commands. All calls on the session's thread;
/// they must not wait for a client.
class LiveOutlet {
 public:
  virtual ~LiveOutlet() = default;

  /// What its clients command now.
  virtual LiveCommands commands() = 0;

  /// Whether a client waits for pictures: otherwise none are drawn.
  virtual bool wants_pictures() const = 0;

  /// Called once a frame.
  virtual void publish(const LiveFrame& frame) = 0;
};

}  // namespace xraycast
