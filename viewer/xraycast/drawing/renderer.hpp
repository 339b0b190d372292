#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/projector.hpp"
#include "xraycast/drawing/gl.hpp"
#include "xraycast/drawing/surface_layer.hpp"
#include "xraycast/sampling/map_texels.hpp"
#include "xraycast/sampling/rectified_view.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"
#include "xraycast/scene/scene.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Draws a body map, or a true projection in its place, with surfaces within it. Needs an OpenGL 3.3 context
/// (HeadlessContext or a window's), the same for all calls.
///
/// A frame is made in passes: the body's optical depth, for maps about a straight axis on the columns of a
/// RectifiedView, otherwise pixel by pixel; the surfaces; what lies in front of opaque ones; and the display,
/// which looks all of these up and turns them into grey. The body is drawn anew only for another map, view or
/// style: under a C-arm that stands still a catheter's frames cost no more than the catheter. Optical depths
/// are 32-bit floats throughout.
class Renderer {
 public:
  Renderer();

  /// What the body is drawn from; none: nothing but surfaces.
  void set_map(std::shared_ptr<const BodyMap> map);

  /// Throws InputError as `check` does.
  void set_surfaces(std::span<const Surface> surfaces);

  /// Another surface in the place of one of them, or after the last; what moves is replaced at every frame.
  /// Throws as set_surfaces.
  void replace_surface(std::size_t index, const Surface& surface);

  /// The picture on the bound framebuffer, whose viewport begins at (x, y) and is as large as the view, which
  /// has to be complete. Throws InputError when the map cannot be drawn so.
  void draw(const View& view, const Style& style, int x = 0, int y = 0);

  /// The same with the true projection for the body, in the fluoro look.
  void draw(const ProjectionImage& truth, const Style& style, int x = 0, int y = 0);

  /// Optical depth of the picture: height x width, row 0 on top. In the surface look it ends at opaque
  /// surfaces.
  std::vector<float> tau(const View& view, const Style& style);

  /// The same of the body alone.
  std::vector<float> body_tau(const View& view, const Style& style);

  /// The picture as 8-bit RGB, row 0 on top.
  std::vector<std::uint8_t> picture(const View& view, const Style& style);
  std::vector<std::uint8_t> picture(const ProjectionImage& truth, const Style& style);

  /// Of the map, as it lies in the GPU's memory.
  std::size_t texture_B() const;

 private:
  enum class Output { grey, tau };
  enum class Surfaces { none, opaque, absorbing };

  /// Where the display finds the body.
  struct Body {
    glm::dmat3 from_pixel{1};  ///< to column and row of `body_`
    ScreenBox box{};           ///< outside of it there is no body
    int columns = 0, rows = 0;
    double first_row = -1e9, last_row = 1e9;  ///< between which there is a body
    bool between_columns = false;             ///< pixels lie between columns
  };

  /// What lies in `body_`, and what it was drawn for.
  struct DrawnBody {
    View view;
    Style style;
    Body body;
  };

  /// What was drawn and has to be displayed.
  struct Passes {
    View view;
    Body body;
    Surfaces surfaces;
  };

  bool has_columns() const;
  int channels() const { return map_ && map_->spectrum ? 3 : 1; }
  void prepare_map(const Style& style);
  void prepare_columns(const RectifiedView& rectified, const SampleOptions& options);
  ScreenBox body_box(const View& view) const;
  Passes draw_passes(const View& view, const Style& style);
  Passes draw_passes(const ProjectionImage& truth);
  Body draw_body(const View& view, const Style& style);
  Body draw_columns(const View& view, const Style& style);
  Body draw_march(const View& view, const Style& style);
  void draw_opaque(const View& view);
  void draw_absorption(const View& view);
  void draw_in_front(const View& view, const Style& style);
  void apply_spectrum(int columns, int quads);
  void display_body(const Passes& passes, const Style& style, Output output, glm::ivec2 corner);
  void display_surfaces(const View& view, const Style& style, Output output);
  void display(const Passes& passes, const Style& style, Output output, glm::ivec2 corner);
  std::vector<float> read_tau(const Passes& passes, const Style& style);
  void draw_own(const Passes& passes, const Style& style, Output output);
  void set_columns(const gl::Program& program, const RectifiedView& rectified) const;
  void set_march(const gl::Program& program, const View& view) const;
  void draw_into(const gl::Target& target);
  void attach_depth();
  void cover() const;
  void cover(const ScreenBox& box, glm::ivec2 corner) const;
  const gl::Program& program(const std::string& fragment, const std::string& defines);
  static std::string display_defines(const Style& style, Output output);
  std::string column_defines(const SampleOptions& options) const;
  std::string march_defines(const SampleOptions& options) const;

  std::shared_ptr<const BodyMap> map_;
  MapGeometry geometry_;           ///< of the map, without a field where there is more beyond it
  std::optional<Style> prepared_;  ///< the style that map_texels_ are made for
  MapTexels texels_;               ///< of each channel
  std::vector<gl::Table> map_texels_;
  std::optional<DrawnBody> drawn_;

  std::map<std::string, gl::Program> programs_;
  gl::VertexArray no_vertices_;
  gl::Framebuffer framebuffer_;
  gl::Table column_table_, sample_table_, axis_table_, layer_table_, spectrum_table_;
  gl::Target body_, near_, near_masses_, shade_, surface_depth_, depth_, absorbed_, frame_tau_, frame_grey_;
  std::vector<gl::Target> masses_;
  int spectrum_bins_ = 0;
  SurfaceLayer opaque_;
  AbsorbingSurfaces absorbing_;
};

}  // namespace xraycast
