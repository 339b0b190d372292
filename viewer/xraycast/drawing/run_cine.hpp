#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/coaxial/coaxial_catheters.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/mechanics/catheter.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/simulation/contrast_bolus.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <variant>
#include <vector>

namespace xraycast {

/// The frames of a catheter's run with a fixed C-arm: the body, the catheter, contrast agent while it is
/// injected, and the vessels' outline as a road map. Needs a current OpenGL context.
class RunCine {
 public:
  struct Options {
    View view;            ///< complete
    Style style;          ///< its window is chosen by the first frame
    double step_s = 0.1;  ///< between frames
    double inject_from_s = 0, inject_to_s = 0;
    double injection_ml_s = 5;
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
  /// The same with coaxial devices. Contrast agent is injected through the outermost device's lumen, as long
  /// as that is free.
  void see(const CoaxialCatheters& devices, double time_s);

 private:
  bool is_due(double time_s) const { return time_s >= next_s_; }
  void inject(const CatheterTip& tip, bool has_free_lumen, double time_s);
  void draw_contrast(std::size_t devices);
  void take_frame();

  Options options_;
  std::variant<Screen, Detector> taker_;
  Renderer renderer_;
  ContrastBolus bolus_;
  ContrastSurface contrast_;
  RoadMap road_map_;
  double last_s_ = 0, next_s_ = 0;
};

}  // namespace xraycast
