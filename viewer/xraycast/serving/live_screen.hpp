#pragma once

#include "xraycast/acquisition/console.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/serving/intervention.hpp"
#include "xraycast/serving/live_outlet.hpp"
#include "xraycast/serving/live_session.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace xraycast {

/// Draws the pictures of an intervention without a display, as the window does: the body's map, the
/// instruments and the contrast agent; with a fluoroscope, its pulses.
class LiveScreen final : public LivePainter {
 public:
  struct Options {
    View view;  ///< complete; the whole of it is turned and moved by the pose
    Style style{};
    bool has_window = false;          ///< style.window was chosen; otherwise it is automatic, for each view
    std::vector<Surface> implants{};  ///< objects in the body, which do not move
    bool is_fine = false;             ///< pictures have 16 bits instead of 8
    std::optional<FluoroscopyOptions> fluoroscopy{};
  };

  /// Throws as HeadlessContext, and as FluoroscopyConsole does for its options.
  LiveScreen(std::shared_ptr<const BodyMap> map, const Options& options);

  bool is_due(bool is_live, bool is_gate_open, double passed_s) override;
  PulseBlur blur(const CArmPose& pose) const override;
  RunUse use() const override { return console_ ? console_->use() : RunUse{}; }
  const LivePicture& draw(const Intervention& intervention) override;

  /// Null without a fluoroscope.
  const FluoroscopyConsole* console() const { return console_ ? &*console_ : nullptr; }

 private:
  View view_from(const CArmPose& pose) const;
  void draw_pulse();
  void draw_greys();

  HeadlessContext context_;
  Renderer renderer_;
  std::shared_ptr<const BodyMap> map_;
  Options options_;
  std::optional<FluoroscopyConsole> console_;
  std::optional<WaterPath> water_path_;
  std::optional<View> adapted_to_;  ///< the view that grey window and body's depths are of
  std::vector<float> body_tau_;
  std::size_t surfaces_ = 0;  ///< of the last picture
  LivePicture picture_;
};

}  // namespace xraycast
