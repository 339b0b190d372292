#pragma once

#include "xraycast/acquisition/frame_file.hpp"
#include "xraycast/acquisition/map_acquisition.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/contrast_agent/contrast_bolus.hpp"
#include "xraycast/contrast_agent/injection.hpp"
#include "xraycast/motion/body_request.hpp"
#include "xraycast/motion/moving_points.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/device_tubes.hpp"
#include "xraycast/scene/pulse_blur.hpp"
#include "xraycast/simulation/run_report.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace xraycast {

/// The view with pixels so small that a catheter shows: the map of a coarse scan has too few.
View no_smaller(View view, const BodyBounds& bounds);

/// The frames of a catheter's run with a fixed C-arm: the body, the instruments, contrast agent while it is
/// injected, and without a fluoroscope the vessels' outline as a road map; or a run of digital subtraction
/// angiography, which begins half a second before the injection and whose frames until then are its mask.
/// Walls that yield to a balloon are shown by contrast agent and road map. Needs a current OpenGL context.
class RunCine {
 public:
  struct Options {
    View view;                        ///< complete
    PictureOptions picture{};         ///< the window is chosen by the first frame
    double step_s = 0.1;              ///< between frames; a fluoroscope's follow its pulses
    std::vector<Surface> implants{};  ///< objects in the body, which do not move
    Injection injection;              ///< none: of no duration
    /// Of a subtraction's picture(), the optical depth that is black, kLeastBlack to kMostBlack. None: that
    /// across the vessel at the tip, were it healthy, filled with the agent as the blood dilutes it.
    std::optional<double> black{};
    Blood blood;
    /// Of the run: the contrast agent moves by it, and the map too, if it is one that moves; the road map
    /// stays as it was taken, at phase 0. Frames wait for its gate.
    BodyRequest body{};
  };
  static constexpr double kLeastBlack = 0.01, kMostBlack = 10;
  /// What a run of subtraction shows before the injection; with masks of phases at least a cycle of them.
  static constexpr double kMask_s = 0.5;

  /// The tree must outlive the cine. Throws InputError for a map that moves by other modes than the run.
  RunCine(std::shared_ptr<const BodyMap> map, const VesselTree& tree, const Options& options);

  /// Tell it of a run (see RunListener). Where a frame is due, true: take it then, by frame() or by
  /// picture(). The first follows the first step. Contrast agent is injected while one of the lumens is free;
  /// see agent_outlet.
  bool advance(const Instruments& instruments, double time_s);

  /// Its optical depths, and with a fluoroscope its pulse; neither has a road map.
  const AcquiredFrame& frame();

  /// When that is, by the run's time, and whether an R wave of the body's heart came since the frame before.
  FrameInstant instant() const { return {last_s_, has_r_wave_}; }

  /// The same as it is displayed: 8-bit RGB, row 0 on top.
  std::vector<std::uint8_t> picture();

  const Options& options() const { return options_; }  ///< with the time between its frames
  const Acquisition& acquisition() const { return acquisition_; }

  /// Of a subtraction, the optical depth that picture() shows black; it stays from the injection on.
  double subtraction_black() const { return window_.black; }

  /// The most frames of a run of that time.
  std::int64_t most_frames(double longest_s) const;

  /// So far; of a fluoroscope without a generator no dose.
  RunUse use() const;

 private:
  double begin_s() const;
  bool is_before_injection(double time_s) const;
  double opacified_tau(const VesselTree::Location& tip) const;
  void inject(const Instruments& instruments, double time_s);
  void take_walls(const Instruments& instruments);
  bool takes_frame(const Instruments& instruments, double time_s);
  bool is_exposed(double time_s);
  void note_r_wave(double time_s);
  std::vector<Surface> left_in_body(const Instruments& instruments) const;
  std::vector<Surface> surfaces_of(const Instruments& instruments, const std::vector<Surface>& left,
                                   double later_s, double time_s);
  void add_pushed_coils(const Instruments& instruments, std::vector<Surface>& surfaces) const;
  void place(const Instruments& instruments, double time_s);
  void remember(const Instruments& instruments, double time_s);

  const VesselTree& tree_;
  Options options_;
  Acquisition acquisition_;
  Renderer renderer_;
  ContrastBolus bolus_;
  ContrastSurface contrast_;
  std::optional<MovingPoints> contrast_points_;
  RoadMap road_map_;
  std::size_t placed_ = 0;   ///< surfaces
  long vessel_changes_ = 0;  ///< that pictures show; see Instruments
  SubtractionWindow window_;
  std::vector<float> tau_;
  double last_s_ = 0, next_flow_s_ = 0;
  double next_s_;  ///< of a frame
  PulseBlur blur_;
  std::vector<std::vector<glm::dvec3>> before_mm_;  ///< the instruments' nodes a step ago
  double before_s_ = 0;
  double last_frame_s_ = 0;
  bool has_r_wave_ = false;
};

}  // namespace xraycast
