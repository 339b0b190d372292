#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/serving/intervention.hpp"
#include "xraycast/serving/live_outlet.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Draws for a session.
class LivePainter {
 public:
  virtual ~LivePainter() = default;

  /// Whether a live frame is a pulse of X-rays, which a closed gate puts off. Called once a frame, whoever
  /// watches, with the time since the last call.
  virtual bool is_due(bool is_live, bool is_gate_open, double passed_s) = 0;

  /// How its pulses see what moves.
  virtual PulseBlur blur(const CArmPose& pose) const {
    static_cast<void>(pose);
    return {};
  }

  /// What its pulses have used; nothing where they are none.
  virtual RunUse use() const { return {}; }

  /// The last exposure, valid until the next call. Throws InputError where it cannot be drawn.
  virtual const LivePicture& draw(const Intervention& intervention) = 0;
};

/// An intervention that clients steer and watch, without a window: the window's loop. All calls on one
/// thread.
///
/// Of several outlets, the pedal is down while it is down in any; the greatest rate is injected; velocities
/// add up; the C-arm follows the last one that asks for a pose.
class LiveSession {
 public:
  /// Receives one line at a time.
  using Log = std::function<void(const std::string& line)>;

  /// What it refers to must outlive it.
  LiveSession(Intervention& intervention, const BodyBounds& bounds, const CArmPose& pose,
              LivePainter& painter, Log log)
      : intervention_(intervention), bounds_(bounds), pose_(pose), painter_(painter), log_(std::move(log)) {}

  void add(LiveOutlet& outlet) { outlets_.push_back(&outlet); }

  /// A frame: obeys the commands, exposes, draws where somebody waits for a picture and there is a new one,
  /// and publishes. The first one is drawn whoever waits, and throws InputError where it cannot be drawn; at
  /// poses of later ones that cannot be, the C-arm stays where it was.
  void step(double passed_s);

  /// Frames at a rate, until the progress is cancelled. One that is late makes the next ones no denser.
  void run(double rate_hz, const Progress& progress);

  struct Counts {
    std::int64_t frames = 0, pictures = 0;
  };
  const Counts& counts() const { return counts_; }

 private:
  void obey();
  void change_body(const LiveCommands& commands);
  void treat(const LiveCommands& commands);
  void move_c_arm(const CArmRequest& request);
  bool is_watched() const;
  void expose(double passed_s);
  const LivePicture* draw();
  const LivePicture* draw_from_before(const std::string& why);

  Intervention& intervention_;
  BodyBounds bounds_;
  CArmPose pose_;
  LivePainter& painter_;
  Log log_;
  std::vector<LiveOutlet*> outlets_;
  long exposures_ = 0;
  bool is_outdated_ = false;            ///< a pulse was not drawn
  std::optional<CArmPose> drawn_from_;  ///< the pose of the last picture
  bool is_refusal_told_ = false;
  std::string refused_;  ///< the last change of the body that could not be
  Counts counts_;
};

}  // namespace xraycast
