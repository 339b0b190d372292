#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/drawing/fullscreen_pass.hpp"
#include "xraycast/drawing/surface_layer.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/sampling/key_texels.hpp"
#include "xraycast/sampling/map_texels.hpp"
#include "xraycast/sampling/rectified_view.hpp"
#include "xraycast/scene/scene.hpp"

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Maps a view's pixels to the texture that a BodyPass has drawn.
struct BodyPicture {
  glm::dmat3 from_pixel{1};  ///< (i + 1/2, j + 1/2, 1) of the view to homogeneous (column, row)
  ScreenBox box{};           ///< outside of it there is no body
  int columns = 0, rows = 0;
  double first_row = -1e9, last_row = 1e9;  ///< between which there is a body
  bool is_resampled = false;                ///< pixels lie between columns, which are interpolated
};

/// A channel of a map in GPU memory, by the map's precision.
struct MapTexture {
  explicit MapTexture(MapPrecision precision);
  void bind(const gl::Program& program) const;
  std::size_t size_B() const { return texels.size_B() + byte_ranges.size_B(); }

  gl::Table texels, byte_ranges;  ///< see map_texels.hpp
};

/// Draws the body's optical depth into a texture of its own: for maps about a straight axis on the columns of
/// a RectifiedView, whose rays sample the map at the same places of its circles, and otherwise by ray
/// marching, pixel by pixel. Four rows of a column share a texel. With a spectrum the masses of the materials
/// are drawn first, one texture each, and the spectrum is applied to their sums.
///
/// The texture is cached: it is redrawn only for another map, instant, view or style. The texels of a map
/// that moves are blended on the processor once for each instant, and shaders know nothing of it: fetching
/// those of all nearest keys would multiply the fetches, which take most of a frame's time.
class BodyPass {
 public:
  /// `screen` must outlive the pass.
  explicit BodyPass(FullscreenPass& screen);

  /// None: no body.
  void set_map(std::shared_ptr<const BodyMap> map);

  /// See Renderer::set_phases.
  void set_phases(std::span<const double> phases);
  bool has_spectrum() const { return map_ && map_->spectrum(); }

  /// Size of the map in GPU memory.
  std::size_t texture_B() const;

  /// The view must be complete. Throws InputError when the map cannot be drawn so.
  BodyPicture draw(const View& view, const Style& style);

  /// A DRR instead of the map.
  BodyPicture draw(const ProjectionImage& drr);

  /// Binds what `draw` has drawn.
  void bind(const gl::Program& program, const char* name, int unit) const { body_.bind(program, name, unit); }

  /// How surfaces must measure their depth for draw_in_front.
  DepthMeasure depth_measure() const;

  /// Draws the part of the body between opaque surfaces and the detector into a second texture, in the pixels
  /// of `box` where `depth` has surfaces: the optical depth, or with a spectrum the masses of the materials.
  /// `surface_depth` is measured as depth_measure() says.
  void draw_in_front(const View& view, const Style& style, const gl::Target& surface_depth,
                     const gl::Target& depth, const ScreenBox& box);

  /// Binds what draw_in_front has drawn and, from `unit + 1` on, the spectrum where there is one.
  void bind_in_front(const gl::Program& program, const char* name, int unit) const;

 private:
  /// The content of `body_`, and the map, view and style that it was drawn for.
  struct Drawn {
    View view;
    Style style;
    BodyPicture picture;
  };

  int channels() const { return has_spectrum() ? 3 : 1; }
  void prepare(const Style& style);
  void upload_map(const MapGeometry& drawn, const Style& style);
  void upload_channel(int channel, const Style& style);
  void upload_ranges(MapTexture& texture, std::span<const LayerByteRange> byte_ranges);
  void blend();
  std::string variant(const std::string& defines) const;
  void upload_march_tables(const MapGeometry& drawn, const SampleOptions& options);
  void upload_bands();
  void upload_samples(const RectifiedView& rectified, const SampleOptions& options);
  template <typename Draw>
  void draw_channels(int columns, int rows, const Draw& draw_channel);
  BodyPicture draw_columns(const View& view, const Style& style);
  BodyPicture draw_march(const View& view, const Style& style);
  void apply_spectrum();
  void bind_spectrum(const gl::Program& program, int unit) const;
  ScreenBox body_box(const View& view) const;
  const gl::Program& use_columns(const std::string& fragment, const std::string& defines,
                                 const RectifiedView& rectified, const SampleOptions& options);
  const gl::Program& use_march(const std::string& fragment, const View& view, const SampleOptions& options);

  FullscreenPass& screen_;
  std::shared_ptr<const BodyMap> map_;
  MapGeometry geometry_;              ///< of the map, without its field if the body extends beyond it
  std::optional<Style> prepared_;     ///< the style that the map's texels are made for
  MapTexels texels_;                  ///< of each channel
  std::vector<MapTexture> textures_;  ///< of the channels
  std::vector<KeyTexels> keys_;       ///< of the channels of a map that moves
  std::vector<double> phases_;        ///< of its modes
  bool has_columns_ = false;          ///< see has_columns
  bool is_blended_ = false;           ///< the textures are those of the phases
  gl::Table column_table_, sample_table_, axis_table_, layer_table_, outline_table_, band_table_,
      spectrum_table_;
  std::vector<glm::vec2> bands_;  ///< first and last row of each band of rows that share an outline
  int spectrum_bins_ = 0;
  std::optional<Drawn> drawn_;
  gl::Target body_;
  std::array<gl::Target, 3> masses_;  ///< of the materials, with a spectrum
  gl::Target near_, near_masses_;
};

}  // namespace xraycast
