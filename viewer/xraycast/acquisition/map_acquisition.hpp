#pragma once

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/motion.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/moving_surface.hpp"
#include "xraycast/scene/road_map.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// How a body map's pictures are drawn, acquired and displayed.
struct PictureOptions {
  Style style{};
  bool has_window = false;  ///< style.window was chosen; otherwise it is automatic, for each view
  AcquisitionOptions acquisition{};
  GreyDisplay display{};         ///< of pulses and differences
  bool has_annotations = false;  ///< orientation letters, axis, scale bar, and the C-arm's angles
};

/// Chooses `fluoro`, `surface`, or `dsa`, which is subtraction of attenuating vessels. Throws InputError.
void choose_look(const std::string& look, PictureOptions& options);

/// Throws InputError for what has no effect or contradicts itself.
void check(const PictureOptions& options, bool has_vessels, bool has_instruments);

/// What lies between source and detector.
struct MapScene {
  std::shared_ptr<const BodyMap> map;
  std::optional<Surface> vessels{};  ///< filled with contrast agent, which a mask has not
  std::vector<Surface> instruments{};
  std::vector<Surface> implants{};       ///< objects that do not move
  std::optional<VesselTree> road_map{};  ///< whose outline is drawn into displayed pictures
  /// By which the vessels move with a map that does; its modes are the map's, in order. Null: they stay.
  std::shared_ptr<const Motion> motion{};
};

/// Pictures of a body map with vessels and instruments, from one view after the other.
class MapAcquisition {
 public:
  /// The renderer, which has the map, must outlive it. Throws as `check` and Acquisition.
  MapAcquisition(Renderer& renderer, MapScene scene, const PictureOptions& options, const View& first);

  /// The instant of the next frames, of the map (see Renderer::set_phases) and of the vessels.
  void set_phases(std::span<const double> phases);

  /// Masks are taken while a mode stands at a phase of its own; until then as it does in the frame.
  void hold_masks(const MaskMatching& masks) { masks_ = masks; }

  /// The next frame, subtracted from a mask of the same view. Throws InputError when the map cannot be drawn
  /// so.
  const AcquiredFrame& frame(const View& view);

  /// The same as it is displayed: 8-bit RGB, row 0 on top. All differences have the first one's window.
  std::vector<std::uint8_t> picture(const View& view);

  const Acquisition& acquisition() const { return acquisition_; }

 private:
  std::vector<std::uint8_t> greys(const View& view);
  std::vector<std::uint8_t> drawn(const View& view);
  void show_vessels(bool shows);
  void take_mask(const View& view);

  Renderer& renderer_;
  MapScene scene_;
  PictureOptions options_;
  Acquisition acquisition_;
  std::optional<MovingSurface> moving_;  ///< the vessels
  std::optional<MaskMatching> masks_;
  std::vector<double> phases_;
  std::optional<RoadMap> road_map_;
  std::optional<SubtractionWindow> window_;
  std::vector<float> tau_;  ///< of the frame
};

}  // namespace xraycast
