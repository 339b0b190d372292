#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/fluoroscope/subtraction.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/simulation/contrast_bolus.hpp"
#include "xraycast/simulation/injection.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <variant>
#include <vector>

namespace xraycast {

/// The frames of a catheter's run with a fixed C-arm: the body, the devices, contrast agent while it is
/// injected, and the vessels' outline as a road map; or a run of digital subtraction angiography, which
/// begins half a second before the injection and whose frames until then are its mask. Needs a current OpenGL
/// context.
class RunCine {
 public:
  struct Options {
    View view;            ///< complete
    Style style;          ///< its window is chosen by the first frame
    double step_s = 0.1;  ///< between frames
    Injection injection;  ///< none: of no duration
    Blood blood;
    bool subtracts = false;
    PixelShift mask_shift;                     ///< subtraction: of the mask
    bool shows_maximum_opacification = false;  ///< subtraction: every frame has the vessels filled so far
    /// Subtraction on a Screen: what a detector makes of a frame's optical depths; none: those themselves.
    std::function<std::vector<float>(const std::vector<float>& tau)> measure;
  };
  static constexpr double kMask_s = 0.5;  ///< what a run of subtraction shows before the injection
  /// Takes a frame: 8-bit RGB, row 0 on top.
  using Screen = std::function<void(std::vector<std::uint8_t> rgb)>;
  /// Takes a frame's optical depths, without the road map and before subtraction, row 0 on top.
  using Detector = std::function<void(std::vector<float> tau)>;

  /// The tree must outlive the cine.
  RunCine(std::shared_ptr<const BodyMap> map, const VesselTree& tree, const Options& options,
          std::variant<Screen, Detector> taker);

  /// Call after every step of the simulation; draws a frame when one is due.
  /// Contrast agent is injected while one of the lumens is free; see agent_outlet.
  void see(const Instruments& devices, double time_s);

  double injected_ml() const { return injected_ml_; }
  /// What was not injected, because no lumen was free.
  double withheld_ml() const { return withheld_ml_; }

  /// Subtraction: how many frames at the beginning the mask is the mean of.
  int mask_frames() const { return subtraction_.mask_frames(); }

 private:
  bool is_before_injection(double time_s) const;
  double opacified_tau(const VesselTree::Location& tip) const;
  void inject(const VesselTree::Location& tip, bool is_lumen_free, double time_s);
  bool is_in_run(double time_s) const;
  void draw(const std::vector<glm::dvec3>& nodes_mm, const InstrumentModel& instrument);
  void take_frame();
  std::vector<std::uint8_t> subtracted(const std::vector<float>& tau);

  const VesselTree& tree_;
  Options options_;
  std::variant<Screen, Detector> taker_;
  Renderer renderer_;
  ContrastBolus bolus_;
  ContrastSurface contrast_;
  RoadMap road_map_;
  Subtraction subtraction_;
  MaximumOpacification opacified_;
  SubtractionWindow window_;
  std::size_t surfaces_ = 0;  ///< of the devices
  double last_s_ = 0, next_s_ = 0, injected_ml_ = 0, withheld_ml_ = 0;
};

}  // namespace xraycast
