#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/mechanics/catheter.hpp"
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

/// The frames of a catheter's run with a fixed C-arm: the body, the catheter, contrast agent while it is
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
    /// For subtraction: it begins half a second before the injection; the frames until then are the mask.
    bool begins_with_mask = false;
  };
  /// Takes a frame: 8-bit RGB, row 0 on top.
  using Screen = std::function<void(std::vector<std::uint8_t> rgb)>;
  /// Takes a frame's optical depths, without the road map, row 0 on top.
  using Detector = std::function<void(std::vector<float> tau)>;

  /// The tree must outlive the cine.
  RunCine(std::shared_ptr<const BodyMap> map, const VesselTree& tree, const Options& options,
          std::variant<Screen, Detector> taker);

  /// Call after every step of the simulation; draws a frame when one is due.
  void see(const Catheter& catheter, double time_s);

  /// Whether the frame that is taken precedes the injection; the first one does in any case.
  bool is_mask() const { return is_mask_; }

  /// The optical depth across the vessel at the tip when it is filled with the injected agent.
  double opacified_tau() const;

 private:
  void take_frame();

  const VesselTree& tree_;
  Options options_;
  std::variant<Screen, Detector> taker_;
  Renderer renderer_;
  ContrastBolus bolus_;
  ContrastSurface contrast_;
  RoadMap road_map_;
  VesselTree::Location tip_;
  bool is_first_ = true, is_mask_ = true;
  double last_s_ = 0, next_s_ = 0;
};

}  // namespace xraycast
