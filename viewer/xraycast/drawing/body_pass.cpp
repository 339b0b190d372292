#include "xraycast/drawing/body_pass.hpp"

#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/kernels/params.h"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr int kLayerPlaces = 4096;

std::span<const float> floats(const auto& values) {
  return {reinterpret_cast<const float*>(values.data()), values.size() * sizeof(values[0]) / sizeof(float)};
}

/// Whether the map's texels that were made for one style serve the other.
bool same_texels(const Style& a, const Style& b) {
  return a.sampling.compositing == b.sampling.compositing &&
         a.sampling.reconstruction == b.sampling.reconstruction && a.layer_weights == b.layer_weights;
}

/// Whether a body that was drawn in one style looks the same in the other.
bool same_body(const Style& a, const Style& b) {
  return a.sampling == b.sampling && a.layer_weights == b.layer_weights &&
         a.pixels_per_column == b.pixels_per_column;
}

/// Walls have hard edges, at which fewer columns would be seen.
int pixels_per_column(const Style& style) {
  return style.sampling.compositing == Compositing::wall ? kFullResolution : style.pixels_per_column;
}

int quads_of(int rows) { return (rows + 3) / 4; }

/// From pixels to the columns and rows of a picture that has a column at every so many of them.
glm::dmat3 scaled_down(int pixels_per_column) {
  return {1.0 / pixels_per_column, 0, 0, 0, 1, 0, -0.5 / pixels_per_column, -0.5, 1};
}

std::string column_defines(const MapGeometry& geometry, const SampleOptions& options) {
  std::string defines;
  if (options.blends_layers(geometry)) defines += "BLENDS_LAYERS ";
  if (options.compositing == Compositing::path && geometry.ray_layout == RayLayout::cylinder)
    defines += "PATH ";
  return defines;
}

std::string march_defines(const MapGeometry& geometry, const SampleOptions& options) {
  std::string defines;
  if (geometry.ray_layout == RayLayout::sphere) defines += "SPHERE ";
  if (options.compositing == Compositing::wall) defines += "WALL ";
  if (geometry.has_outline()) defines += "OUTLINE ";
  return defines;
}

/// The texture's rows are indexed by 32-bit floats (ColumnSample).
void check_columns(const MapGeometry& drawn) {
  constexpr std::int64_t kMaxColumns = 1 << 24;
  if (const std::int64_t columns = std::int64_t{drawn.layers()} * (drawn.width + 1); columns > kMaxColumns)
    throw InputError(
        "the body map has {} columns in its {} layers, but at most {} can be drawn; cast fewer angles or "
        "layers",
        columns, drawn.layers(), kMaxColumns);
}

/// Four rows of a picture to a texel.
std::vector<float> packed_quads(const ProjectionImage& image) {
  const int width = image.view.width, height = image.view.height;
  std::vector<float> quads(static_cast<std::size_t>(4) * width * quads_of(height));
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i)
      quads[4 * (static_cast<std::size_t>(j / 4) * width + i) + j % 4] =
          image.tau[static_cast<std::size_t>(j) * width + i];
  return quads;
}

GLenum texture_format(MapPrecision precision) {
  switch (precision) {
    case MapPrecision::float32:
      return GL_RGBA32F;
    case MapPrecision::float16:
      return GL_RGBA16F;
    case MapPrecision::byte:
      return GL_RGBA8;
  }
  return GL_RGBA32F;
}

}  // namespace

MapTexture::MapTexture(MapPrecision precision) : texels(texture_format(precision)), byte_ranges(GL_RGBA32F) {}

void MapTexture::bind(const gl::Program& program) const {
  constexpr int kTexelsUnit = 0, kRangesUnit = 7;  // behind those of the tables of views
  texels.bind(program, "map_texels", kTexelsUnit);
  if (byte_ranges.size_B() > 0) byte_ranges.bind(program, "byte_ranges", kRangesUnit);
}

BodyPass::BodyPass(FullscreenPass& screen)
    : screen_(screen),
      column_table_(GL_RGBA32F),
      sample_table_(GL_RGBA32F),
      axis_table_(GL_RG32F),
      layer_table_(GL_RG32F),
      outline_table_(GL_R32F),
      band_table_(GL_RG32F),
      spectrum_table_(GL_RGBA32F),
      body_(GL_RGBA32F),
      masses_{gl::Target(GL_RGBA32F), gl::Target(GL_RGBA32F), gl::Target(GL_RGBA32F)},
      near_(GL_R32F),
      near_masses_(GL_RGBA32F) {}

// ---- the map --------------------------------------------------------------------------------------

void BodyPass::set_map(std::shared_ptr<const BodyMap> map) {
  if (map && map == map_) return;
  if (!map || !map_ || map->precision != map_->precision) textures_.clear();
  map_ = std::move(map);
  prepared_.reset();
  drawn_.reset();
  keys_.clear();
  phases_.clear();
  if (!map_) return;
  if (map_->keys) phases_.resize(map_->keys->phases().phases().size(), 0.0);
  geometry_ = drawn_geometry(*map_);
  has_columns_ = has_columns(geometry_);
  upload_bands();
  if (!map_->spectrum()) return;
  const std::vector<std::array<float, 4>> bins = SpectrumModel(*map_->spectrum()).table();
  spectrum_bins_ = static_cast<int>(bins.size());
  spectrum_table_.fill(floats(bins), "spectrum");
}

void BodyPass::set_phases(std::span<const double> phases) {
  if (!map_ || !map_->keys || std::ranges::equal(phases, phases_)) return;
  if (phases.size() != phases_.size())
    throw InputError("{} for a map of {}; give one for each", pluralize(phases.size(), "phase"),
                     pluralize(phases_.size(), "mode"));
  phases_.assign(phases.begin(), phases.end());
  is_blended_ = false;
  drawn_.reset();
}

std::size_t BodyPass::texture_B() const {
  std::size_t size = 0;
  for (const MapTexture& texture : textures_) size += texture.size_B();
  return size;
}

DepthMeasure BodyPass::depth_measure() const {
  return map_ && has_columns_ ? DepthMeasure::horizontal : DepthMeasure::along_ray;
}

ScreenBox BodyPass::body_box(const View& view) const {
  return screen_box(view, corners_mm(bounds_of(geometry_), view));
}

void BodyPass::prepare(const Style& style) {
  if (prepared_ && same_texels(*prepared_, style)) return blend();
  prepared_.reset();  // should preparing fail
  const MapGeometry drawn = drawn_shells(geometry_, style.sampling);
  check_columns(drawn);
  upload_map(drawn, style);
  if (!has_columns_) upload_march_tables(drawn, style.sampling);
  blend();
  prepared_ = style;
}

/// Of a map that moves: fills the textures for its phases.
void BodyPass::blend() {
  if (!map_->keys || is_blended_) return;
  for (std::size_t channel = 0; channel < keys_.size(); ++channel)
    textures_[channel].texels.fill_bytes(
        texels_.values(),
        [&](std::span<std::byte> texels) { keys_[channel].blend(*map_->keys, phases_, texels); },
        "the body map");
  is_blended_ = true;
}

void BodyPass::upload_map(const MapGeometry& drawn, const Style& style) {
  texels_ = texels_of(drawn);
  keys_.clear();
  is_blended_ = false;
  while (textures_.size() > static_cast<std::size_t>(channels())) textures_.pop_back();
  while (textures_.size() < static_cast<std::size_t>(channels())) textures_.emplace_back(map_->precision);
  for (int channel = 0; channel < channels(); ++channel) upload_channel(channel, style);
}

void BodyPass::upload_channel(int channel, const Style& style) {
  MapTexture& texture = textures_[static_cast<std::size_t>(channel)];
  if (map_->keys) {
    const KeyTexels& keys =
        keys_.emplace_back(*map_->keys, channel, geometry_, style.sampling, style.layer_weights);
    return upload_ranges(texture, keys.byte_ranges());
  }
  const auto make = [&](std::span<float> texels) {
    make_texels(geometry_, map_->spectrum() ? map_->depths[channel] : map_->tau, style.sampling,
                style.layer_weights, texels);
  };
  if (map_->precision == MapPrecision::float32)
    return texture.texels.fill(texels_.values(), make, "the body map");
  std::vector<float> texels(texels_.values());
  make(texels);
  const PackedTexels packed = pack_texels(texels_, texels, map_->precision);
  texture.texels.fill_bytes(packed.values, "the body map");
  if (!packed.byte_ranges.empty()) upload_ranges(texture, packed.byte_ranges);
}

void BodyPass::upload_ranges(MapTexture& texture, std::span<const LayerByteRange> byte_ranges) {
  // OpenGL takes bytes for 0 to 1. With every layer's stands the next one's.
  std::vector<std::array<float, 4>> ranges;
  for (std::size_t k = 0; k < byte_ranges.size(); ++k) {
    const LayerByteRange &here = byte_ranges[k], &next = byte_ranges[std::min(k + 1, byte_ranges.size() - 1)];
    ranges.push_back({here.offset, 255 * here.scale, next.offset, 255 * next.scale});
  }
  texture.byte_ranges.fill(floats(ranges), "the body map");
}

/// The names that select a shader's variant, with that for the map's texels.
std::string BodyPass::variant(const std::string& defines) const {
  return map_->precision == MapPrecision::byte ? defines + " BYTES" : defines;
}

void BodyPass::upload_march_tables(const MapGeometry& drawn, const SampleOptions& options) {
  std::vector<glm::vec2> axis, places;
  for (const glm::dvec2& centre : drawn.centre_mm) axis.emplace_back(centre);
  axis_table_.fill(floats(axis), "the map's axis");
  const bool is_wall = options.compositing == Compositing::wall;
  const RadialProfile profile(drawn.radii_mm, is_wall ? Reconstruction::constant : options.reconstruction);
  for (int i = 0; i < kLayerPlaces; ++i) {
    const auto place = profile.at((i + 0.5) / kLayerPlaces * drawn.radius_mm());
    places.emplace_back(place.layer, place.fraction);
  }
  layer_table_.fill(floats(places), "the map's radii");
  if (!drawn.has_outline()) return;
  std::vector<float> scales;
  for (int row = 0; row < drawn.height; ++row)
    for (int column = 0; column <= drawn.width; ++column)
      scales.push_back(static_cast<float>(drawn.scale(column % drawn.width, row)));
  outline_table_.fill(scales, "the map's outline");
}

void BodyPass::upload_bands() {
  // Beyond the map's ends there is nothing that another band could have.
  constexpr float kBeyond = 1e9;
  bands_.clear();
  for (const OutlineBand& band : outline_bands(geometry_))
    bands_.emplace_back(band.first_row, band.first_row + band.rows - 1);
  bands_.front().x = -kBeyond;
  bands_.back().y = kBeyond;
  band_table_.fill(floats(bands_), "the map's bands of rows");
}

void BodyPass::upload_samples(const RectifiedView& rectified, const SampleOptions& options) {
  const ColumnSamples samples = column_samples(rectified, drawn_shells(geometry_, options), options);
  column_table_.fill(floats(samples.columns), "the view's columns");
  sample_table_.fill(floats(samples.samples), "the view's samples");
}

// ---- shaders --------------------------------------------------------------------------------------

const gl::Program& BodyPass::use_columns(const std::string& fragment, const std::string& defines,
                                         const RectifiedView& rectified, const SampleOptions& options) {
  const MapGeometry& geometry = geometry_;
  const gl::Program& program = screen_.use(
      fragment, column_defines(geometry, options) + (bands_.size() > 1 ? "BANDS " : "") + variant(defines));
  column_table_.bind(program, "column_table", 1);
  sample_table_.bind(program, "sample_table", 2);
  if (bands_.size() > 1) {
    band_table_.bind(program, "band_table", 5);
    program.set("bands", static_cast<int>(bands_.size()));
    program.set("columns", rectified.columns);
  }
  program.set("quads", texels_.quads);
  program.set("layer_stride", texels_.layer_stride());
  program.set("map_rows", double(geometry.height));
  program.set("first_row", (geometry.top_mm - rectified.top_mm) / geometry.row_spacing_mm);
  program.set("row_step", rectified.row_mm / geometry.row_spacing_mm);
  program.set("slope", -rectified.slope / geometry.row_spacing_mm);
  program.set("source_row", (geometry.top_mm - rectified.source_z_mm) / geometry.row_spacing_mm);
  program.set("row_mm", geometry.row_spacing_mm);
  return program;
}

const gl::Program& BodyPass::use_march(const std::string& fragment, const View& view,
                                       const SampleOptions& options) {
  const MapGeometry& geometry = geometry_;
  const BodyBounds bounds = bounds_of(geometry);
  const gl::Program& program = screen_.use(fragment, variant(march_defines(geometry, options)));
  axis_table_.bind(program, "axis_table", 1);
  layer_table_.bind(program, "layer_table", 2);
  if (geometry.has_outline()) outline_table_.bind(program, "outline_table", 4);
  program.set("quads", texels_.quads);
  program.set("layer_stride", texels_.layer_stride());
  program.set("layer_places", kLayerPlaces);
  program.set("layers", texels_.layers);
  program.set("map_rows", double(geometry.height));
  program.set("map_columns", double(geometry.width));
  program.set("body_centre_mm", bounds.centre_mm);
  program.set("body_radius_mm", bounds.radius_mm);
  program.set("body_half_height_mm", bounds.half_height_mm);
  program.set("radius_mm", geometry.radius_mm());
  program.set("top_mm", geometry.top_mm);
  program.set("row_mm", geometry.row_spacing_mm);
  program.set("step_mm", geometry.step_mm);
  constexpr double kEverywhere_mm = 1e6;
  const FieldOfView field =
      geometry.field.value_or(FieldOfView{glm::dvec3(-kEverywhere_mm), glm::dvec3(kEverywhere_mm)});
  program.set("field_lower_mm", field.lower_mm);
  program.set("field_upper_mm", field.upper_mm);
  program.set("corner_mm", view.pixel_on_detector_mm(-0.5, -0.5));
  program.set("right_mm", view.pixel_mm * view.right());
  program.set("down_mm", -view.pixel_mm * view.up());
  program.set("is_cone", view.cone.has_value());
  program.set("source_mm", view.cone ? view.source_mm() : glm::dvec3(0));
  program.set("beam", view.towards_detector());
  return program;
}

void BodyPass::bind_spectrum(const gl::Program& program, int unit) const {
  spectrum_table_.bind(program, "spectrum_table", unit);
  program.set("spectrum_bins", spectrum_bins_);
}

// ---- the whole body -------------------------------------------------------------------------------

BodyPicture BodyPass::draw(const View& view, const Style& style) {
  if (!map_) {
    body_.resize(1, 1);
    return {};
  }
  if (drawn_ && drawn_->view == view && same_body(drawn_->style, style)) return drawn_->picture;
  drawn_.reset();  // should drawing fail
  prepare(style);
  drawn_ = {view, style, has_columns_ ? draw_columns(view, style) : draw_march(view, style)};
  return drawn_->picture;
}

BodyPicture BodyPass::draw(const ProjectionImage& drr) {
  const View& view = drr.view;
  drawn_.reset();
  body_.resize(view.width, quads_of(view.height));
  body_.fill(packed_quads(drr), 0, 0, body_.width(), body_.height());
  return {scaled_down(1), {0, 0, view.width, view.height}, view.width, view.height};
}

/// Draws every channel of the map by `draw_channel`, and applies the spectrum where there is one.
template <typename Draw>
void BodyPass::draw_channels(int columns, int rows, const Draw& draw_channel) {
  body_.resize(columns, quads_of(rows));
  for (int channel = 0; channel < channels(); ++channel) {
    gl::Target& target = has_spectrum() ? masses_[static_cast<std::size_t>(channel)] : body_;
    target.resize(columns, quads_of(rows));
    screen_.draw_into(target);
    draw_channel(textures_[static_cast<std::size_t>(channel)]);
  }
  if (has_spectrum()) apply_spectrum();
}

BodyPicture BodyPass::draw_columns(const View& view, const Style& style) {
  const RectifiedView rectified = rectified_view(view, geometry_, pixels_per_column(style));
  const bool has_map_rows = !rectified.is_cone() && rectified.slope == 0;
  const double first_row = std::round((geometry_.top_mm - rectified.top_mm) / geometry_.row_spacing_mm);
  upload_samples(rectified, style.sampling);
  draw_channels(rectified.columns, rectified.rows, [&](const MapTexture& map) {
    const gl::Program& program =
        use_columns("columns.frag", has_map_rows ? "MAP_ROWS" : "", rectified, style.sampling);
    map.bind(program);
    program.set("first_quad", static_cast<int>(first_row) / 4);
    if (rectified.columns > 0 && rectified.rows > 0) screen_.draw();
  });
  BodyPicture picture{rectified.from_pixel, body_box(view), rectified.columns, rectified.rows};
  picture.is_resampled = !has_map_rows || pixels_per_column(style) > 1;
  if (has_map_rows) {
    picture.first_row = -0.5 - first_row;
    picture.last_row = geometry_.height - 0.5 - first_row;
  }
  return picture;
}

BodyPicture BodyPass::draw_march(const View& view, const Style& style) {
  const int columns = (view.width - 1) / pixels_per_column(style) + 2;
  draw_channels(columns, view.height, [&](const MapTexture& map) {
    const gl::Program& program = use_march("march.frag", view, style.sampling);
    map.bind(program);
    program.set("pixels_per_column", double(pixels_per_column(style)));
    screen_.draw();
  });
  BodyPicture picture{scaled_down(pixels_per_column(style)), body_box(view), columns, view.height};
  picture.is_resampled = pixels_per_column(style) > 1;
  return picture;
}

void BodyPass::apply_spectrum() {
  screen_.draw_into(body_);
  const gl::Program& program = screen_.use("spectrum.frag", "");
  masses_[0].bind(program, "water", 0);
  masses_[1].bind(program, "bone", 1);
  masses_[2].bind(program, "iodine", 2);
  bind_spectrum(program, 3);
  screen_.draw();
}

// ---- what lies in front of surfaces ---------------------------------------------------------------

void BodyPass::draw_in_front(const View& view, const Style& style, const gl::Target& surface_depth,
                             const gl::Target& depth, const ScreenBox& box) {
  gl::Target& target = has_spectrum() ? near_masses_ : near_;
  target.resize(view.width, view.height);
  screen_.draw_into(target);
  screen_.attach_depth(depth);
  constexpr float kNothing[4] = {};
  if (!map_) return glClearBufferfv(GL_COLOR, 0, kNothing);
  const gl::DepthTest test(FullscreenPass::kOnSurfaces);
  for (int channel = 0; channel < channels(); ++channel) {
    if (has_spectrum()) glColorMask(channel == 0, channel == 1, channel == 2, GL_FALSE);
    const auto shade = [&](const gl::Program& program) {
      textures_[static_cast<std::size_t>(channel)].bind(program);
      surface_depth.bind(program, "surface_depth", 3);
      program.set("view_height", double(view.height));
      screen_.draw(box);
    };
    if (has_columns_) {
      const RectifiedView rectified = rectified_view(view, geometry_, pixels_per_column(style));
      const gl::Program& program = use_columns("near_columns.frag", "", rectified, style.sampling);
      program.set("from_pixel", rectified.from_pixel);
      program.set("last_column", rectified.columns - 1.0);
      shade(program);
    } else {
      shade(use_march("near_march.frag", view, style.sampling));
    }
  }
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

void BodyPass::bind_in_front(const gl::Program& program, const char* name, int unit) const {
  (has_spectrum() ? near_masses_ : near_).bind(program, name, unit);
  if (has_spectrum()) bind_spectrum(program, unit + 1);
}

}  // namespace xraycast
