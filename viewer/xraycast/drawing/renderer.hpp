#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/drawing/body_pass.hpp"
#include "xraycast/drawing/fullscreen_pass.hpp"
#include "xraycast/drawing/gl.hpp"
#include "xraycast/drawing/surface_layer.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"
#include "xraycast/scene/scene.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Draws a body map, or a DRR in its place, with surfaces within it. Needs an OpenGL 3.3 context
/// (HeadlessContext or a window's), the same for all calls.
///
/// A frame is made in passes: the body's optical depth (BodyPass); the surfaces; the body in front of opaque
/// ones; and the display, which combines these into grey. The body's pass is cached while map, view and style
/// do not change: with a C-arm at rest the frames of a moving catheter cost only the catheter. Optical depths
/// are 32-bit floats throughout.
class Renderer {
 public:
  Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// The map to draw; none: surfaces only.
  void set_map(std::shared_ptr<const BodyMap> map) { body_.set_map(std::move(map)); }

  /// The instant at which a map of a body that moves is drawn: a phase for each of its modes, in the order of
  /// its keys; phase 0 of all of them when the map is set. Without effect on a map that stands still, and
  /// without cost where the phases are those of the last call. Throws InputError for another number of
  /// phases.
  void set_phases(std::span<const double> phases) { body_.set_phases(phases); }

  /// Throws InputError as `check` does.
  void set_surfaces(std::span<const Surface> surfaces);

  /// Replaces one of the surfaces, or appends one; moving surfaces are replaced every frame. Throws as
  /// set_surfaces.
  void replace_surface(std::size_t index, const Surface& surface);

  /// Moves the points of one of the surfaces, one for one, as a body in motion does (see MovingSurface):
  /// faster than to replace it. Throws InputError for another number of points.
  void move_surface(std::size_t index, std::span<const glm::vec3> points_mm);

  /// Objects that do not move: they displace nothing, so that what they attenuate adds to the rest, and is
  /// found anew only for another view. Takes away the surfaces that were set before. Throws as set_surfaces.
  void set_implants(std::vector<Surface> implants);

  /// The picture on the bound framebuffer, whose viewport begins at (x, y) and is as large as the view, which
  /// must be complete. Throws InputError when the map cannot be drawn so.
  void draw(const View& view, const Style& style, int x = 0, int y = 0);

  /// The same with a DRR instead of the map; surfaces attenuate, whatever the look.
  void draw(const ProjectionImage& drr, const Style& style, int x = 0, int y = 0);

  /// Optical depth of the picture: height x width, row 0 on top. Where surfaces are shaded it ends at them.
  std::vector<float> tau(const View& view, const Style& style);

  /// The same of the body alone.
  std::vector<float> body_tau(const View& view, const Style& style);

  /// The picture as 8-bit RGB, row 0 on top.
  std::vector<std::uint8_t> picture(const View& view, const Style& style);
  std::vector<std::uint8_t> picture(const ProjectionImage& drr, const Style& style);

  /// Size of the map in GPU memory.
  std::size_t texture_B() const { return body_.texture_B(); }

 private:
  enum class Output { grey, tau };
  enum class Surfaces { none, opaque, absorbing };

  /// The results of the passes before the display.
  struct Frame {
    View view;
    BodyPicture body;
    Surfaces surfaces;
  };

  Frame draw_passes(const View& view, const Style& style);
  Frame draw_passes(const ProjectionImage& drr);
  void draw_opaque(const View& view);
  bool absorbs() const { return !absorbing_.empty() || !implants_.empty(); }
  void draw_absorption(const View& view);
  void find_implants(const View& view);
  void display(const Frame& frame, const Style& style, Output output, glm::ivec2 corner);
  void display_body(const Frame& frame, const Style& style, Output output, glm::ivec2 corner);
  void display_surfaces(const View& view, const Style& style, Output output);
  void display_offscreen(const Frame& frame, const Style& style, Output output);
  std::vector<float> read_tau(const Frame& frame, const Style& style);

  FullscreenPass screen_;
  BodyPass body_;
  SurfaceLayer opaque_;  ///< implants first
  AbsorbingSurfaces absorbing_, absorbing_implants_;
  std::vector<Surface> implants_;
  /// What the implants attenuate in a view, and in which part of it.
  struct ImplantPicture {
    View view;
    ScreenBox box;
    std::vector<float> tau;
  };
  std::optional<ImplantPicture> implant_picture_;
  ScreenBox absorbed_box_;  ///< of the last frame
  gl::Target shade_, surface_depth_, depth_, absorbed_, offscreen_tau_, offscreen_grey_;
};

}  // namespace xraycast
