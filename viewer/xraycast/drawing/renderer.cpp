#include "xraycast/drawing/renderer.hpp"

#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/kernels/params.h"
#include "xraycast/sampling/camera.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr int kLayerPlaces = 4096;

std::span<const float> floats(const auto& values) {
  return {reinterpret_cast<const float*>(values.data()), values.size() * sizeof(values[0]) / sizeof(float)};
}

/// Whether map_texels made for one style serve the other.
bool same_texels(const Style& a, const Style& b) {
  return a.sampling.compositing == b.sampling.compositing &&
         a.sampling.reconstruction == b.sampling.reconstruction && a.strengths == b.strengths;
}

/// Whether a body that was drawn in one style looks the same in the other.
bool same_body(const Style& a, const Style& b) {
  return a.sampling == b.sampling && a.strengths == b.strengths && a.pixels_per_column == b.pixels_per_column;
}

/// Walls have hard edges, which would show.
int pixels_per_column(const Style& style) {
  return style.sampling.compositing == Compositing::wall ? kFullResolution : style.pixels_per_column;
}

// The triangle that covers a target lies behind all surfaces, at the depth to which the buffer is cleared.
constexpr GLenum kOnSurfaces = GL_GREATER, kBesideSurfaces = GL_EQUAL;

int quads_of(int rows) { return (rows + 3) / 4; }

GLuint bound_framebuffer() {
  GLint id = 0;
  glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &id);
  return static_cast<GLuint>(id);
}

/// The bound framebuffer's pixels, turned from OpenGL's bottom row first to ours.
template <typename Value>
void read_rows(int width, int height, GLenum format, GLenum type, std::vector<Value>& values) {
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, format, type, values.data());
  const std::size_t row = values.size() / static_cast<std::size_t>(height);
  for (int j = 0; j < height / 2; ++j)
    std::swap_ranges(&values[j * row], &values[j * row] + row, &values[(height - 1 - j) * row]);
}

/// A picture's pixels that are bound to be read, as 8-bit RGB.
std::vector<std::uint8_t> read_picture(const View& view) {
  std::vector<std::uint8_t> values(static_cast<std::size_t>(3) * view.width * view.height);
  read_rows(view.width, view.height, GL_RGB, GL_UNSIGNED_BYTE, values);
  return values;
}

void set_window(const gl::Program& program, const GreyWindow& window) {
  program.set("scale", window.scale);
  const double contrast = 1 / (window.light - window.dark);
  program.set("contrast", contrast);
  program.set("black", window.dark * contrast);
  program.set("gamma", window.gamma);
  program.set("inverted", window.inverted);
}

/// Pixels to columns and rows of a picture that is drawn pixel by pixel, at every `pixels_per_column`.
glm::dmat3 scaled_down(int pixels_per_column) {
  return {1.0 / pixels_per_column, 0, 0, 0, 1, 0, -0.5 / pixels_per_column, -0.5, 1};
}

}  // namespace

Renderer::Renderer()
    : column_table_(GL_RGBA32F),
      sample_table_(GL_RGBA32F),
      axis_table_(GL_RG32F),
      layer_table_(GL_RG32F),
      spectrum_table_(GL_RGBA32F),
      body_(GL_RGBA32F),
      near_(GL_R32F),
      near_masses_(GL_RGBA32F),
      shade_(GL_RGBA8),
      surface_depth_(GL_R32F),
      depth_(GL_DEPTH_COMPONENT32F),
      absorbed_(GL_R32F),
      frame_tau_(GL_R32F),
      frame_grey_(GL_RGBA8) {}

// ---- what is drawn --------------------------------------------------------------------------------

void Renderer::set_map(std::shared_ptr<const BodyMap> map) {
  map_ = std::move(map);
  prepared_.reset();
  drawn_.reset();
  if (!map_) return;
  geometry_ = map_->geometry;
  // Where air absorbs, rays met more of it beyond the scan.
  if (!map_->spectrum && map_->opacity.mu_per_mm(XRC_PADDING_HU) > 0) geometry_.field.reset();
  if (!map_->spectrum) return;
  const std::vector<std::array<float, 4>> bins = SpectrumModel(*map_->spectrum).table();
  spectrum_bins_ = static_cast<int>(bins.size());
  spectrum_table_.fill(floats(bins), "spectrum");
}

void Renderer::set_surfaces(std::span<const Surface> surfaces) {
  std::ranges::for_each(surfaces, check);
  opaque_.set(surfaces);
  absorbing_.set(surfaces);
}

void Renderer::replace_surface(std::size_t index, const Surface& surface) {
  check(surface);
  opaque_.replace(index, surface);
  absorbing_.replace(index, surface);
}

std::size_t Renderer::texture_B() const {
  std::size_t size = 0;
  for (const gl::Table& texels : map_texels_) size += texels.size_B();
  return size;
}

bool Renderer::has_columns() const {
  return geometry_.projection != Projection::sphere && geometry_.centre_mm.size() == 1;
}

void Renderer::prepare_map(const Style& style) {
  if (prepared_ && same_texels(*prepared_, style)) return;
  const MapGeometry geometry = drawn_shells(geometry_, style.sampling);
  prepared_.reset();                             // should preparing fail
  constexpr std::int64_t kMaxColumns = 1 << 24;  // whose numbers 32-bit floats hold (ColumnSample)
  if (const std::int64_t columns = std::int64_t{geometry.layers()} * (geometry.width + 1);
      columns > kMaxColumns)
    throw InputError(
        "the body map has {} columns in its {} layers, but frames are drawn of up to {}; cast fewer", columns,
        geometry.layers(), kMaxColumns);
  texels_ = texels_of(geometry);
  while (map_texels_.size() > static_cast<std::size_t>(channels())) map_texels_.pop_back();
  while (map_texels_.size() < static_cast<std::size_t>(channels())) map_texels_.emplace_back(GL_RGBA32F);
  for (int channel = 0; channel < channels(); ++channel)
    map_texels_[channel].fill(
        texels_.values(),
        [&](std::span<float> texels) {
          make_texels(geometry_, map_->spectrum ? map_->depths[channel] : map_->tau, style.sampling,
                      style.strengths, texels);
        },
        "the body map");
  prepared_ = style;
  if (has_columns()) return;
  std::vector<glm::vec2> axis, places;
  for (const glm::dvec2& centre : geometry.centre_mm) axis.emplace_back(centre);
  axis_table_.fill(floats(axis), "the map's axis");
  const bool is_wall = style.sampling.compositing == Compositing::wall;
  const RadialProfile profile(geometry.radii_mm,
                              is_wall ? Reconstruction::constant : style.sampling.reconstruction);
  for (int i = 0; i < kLayerPlaces; ++i) {
    const auto place = profile.at((i + 0.5) / kLayerPlaces * geometry.radius_mm());
    places.emplace_back(place.layer, place.share);
  }
  layer_table_.fill(floats(places), "the map's radii");
}

// ---- passes ---------------------------------------------------------------------------------------

const gl::Program& Renderer::program(const std::string& fragment, const std::string& defines) {
  const auto [entry, is_new] =
      programs_.try_emplace(fragment + ' ' + defines, "screen.vert", fragment, defines);
  entry->second.use();
  return entry->second;
}

void Renderer::draw_into(const gl::Target& target) {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target.texture(), 0);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, 0, 0);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, 0, 0);
  constexpr GLenum kFirst = GL_COLOR_ATTACHMENT0;
  glDrawBuffers(1, &kFirst);
  glViewport(0, 0, target.width(), target.height());
}

void Renderer::attach_depth() {
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth_.texture(), 0);
}

void Renderer::cover() const {
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void Renderer::cover(const ScreenBox& box, glm::ivec2 corner) const {
  const gl::Scissor scissor(corner.x + box.x, corner.y + box.y, box.width, box.height);
  cover();
}

std::string Renderer::column_defines(const SampleOptions& options) const {
  std::string defines;
  if (options.blends_layers(geometry_)) defines += "BLENDS_LAYERS ";
  if (options.compositing == Compositing::path && geometry_.projection == Projection::cylinder)
    defines += "PATH ";
  return defines;
}

std::string Renderer::march_defines(const SampleOptions& options) const {
  std::string defines;
  if (geometry_.projection == Projection::sphere) defines += "SPHERE ";
  if (options.compositing == Compositing::wall) defines += "WALL ";
  return defines;
}

ScreenBox Renderer::body_box(const View& view) const {
  return screen_box(view, corners_mm(bounds_of(geometry_), view));
}

void Renderer::prepare_columns(const RectifiedView& upright, const SampleOptions& options) {
  const ColumnSamples samples = column_samples(upright, drawn_shells(geometry_, options), options);
  column_table_.fill(floats(samples.columns), "the view's columns");
  sample_table_.fill(floats(samples.samples), "the view's samples");
}

void Renderer::set_columns(const gl::Program& program, const RectifiedView& upright) const {
  const MapGeometry& geometry = geometry_;
  column_table_.bind(program, "column_table", 1);
  sample_table_.bind(program, "sample_table", 2);
  program.set("quads", texels_.quads);
  program.set("layer_stride", texels_.layer_stride());
  program.set("map_rows", double(geometry.height));
  program.set("first_row", (geometry.top_mm - upright.top_mm) / geometry.row_spacing_mm);
  program.set("row_step", upright.row_mm / geometry.row_spacing_mm);
  program.set("fall", -upright.slope / geometry.row_spacing_mm);
  program.set("source_row", (geometry.top_mm - upright.source_z_mm) / geometry.row_spacing_mm);
  program.set("row_mm", geometry.row_spacing_mm);
}

void Renderer::set_march(const gl::Program& program, const View& view) const {
  const MapGeometry& geometry = geometry_;
  const BodyBounds bounds = bounds_of(geometry);
  axis_table_.bind(program, "axis_table", 1);
  layer_table_.bind(program, "layer_table", 2);
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
}

Renderer::Body Renderer::draw_columns(const View& view, const Style& style) {
  const RectifiedView upright = rectified_view(view, geometry_, pixels_per_column(style));
  const bool is_level = !upright.is_cone() && upright.slope == 0;
  const bool is_aligned = is_level && pixels_per_column(style) == 1;
  const double first_row = std::round((geometry_.top_mm - upright.top_mm) / geometry_.row_spacing_mm);
  prepare_columns(upright, style.sampling);
  const int quads = quads_of(upright.rows);
  for (int channel = 0; channel < channels(); ++channel) {
    gl::Target& target = channels() > 1 ? masses_[channel] : body_;
    target.resize(upright.columns, quads);
    draw_into(target);
    const gl::Program& columns =
        program("columns.frag", column_defines(style.sampling) + (is_level ? "LEVEL" : ""));
    set_columns(columns, upright);
    map_texels_[channel].bind(columns, "map_texels", 0);
    columns.set("first_quad", static_cast<int>(first_row) / 4);
    if (upright.columns > 0 && quads > 0) cover();
  }
  if (channels() > 1) apply_spectrum(upright.columns, quads);
  Body body{upright.from_pixel, body_box(view), upright.columns, upright.rows};
  body.between_columns = !is_aligned;
  if (is_level) {
    body.first_row = -0.5 - first_row;
    body.last_row = geometry_.height - 0.5 - first_row;
  }
  return body;
}

Renderer::Body Renderer::draw_march(const View& view, const Style& style) {
  const int columns = (view.width - 1) / pixels_per_column(style) + 2;
  const int quads = quads_of(view.height);
  for (int channel = 0; channel < channels(); ++channel) {
    gl::Target& target = channels() > 1 ? masses_[channel] : body_;
    target.resize(columns, quads);
    draw_into(target);
    const gl::Program& march = program("march.frag", march_defines(style.sampling));
    set_march(march, view);
    map_texels_[channel].bind(march, "map_texels", 0);
    march.set("pixels_per_column", double(pixels_per_column(style)));
    cover();
  }
  if (channels() > 1) apply_spectrum(columns, quads);
  Body body{scaled_down(pixels_per_column(style)), body_box(view), columns, view.height};
  body.between_columns = pixels_per_column(style) > 1;
  return body;
}

void Renderer::apply_spectrum(int columns, int quads) {
  body_.resize(columns, quads);
  draw_into(body_);
  const gl::Program& spectrum = program("spectrum.frag", "");
  masses_[0].bind(spectrum, "water", 0);
  masses_[1].bind(spectrum, "bone", 1);
  masses_[2].bind(spectrum, "iodine", 2);
  spectrum_table_.bind(spectrum, "spectrum_table", 3);
  spectrum.set("spectrum_bins", spectrum_bins_);
  cover();
}

Renderer::Body Renderer::draw_body(const View& view, const Style& style) {
  if (!map_) {
    body_.resize(1, 1);
    return {};
  }
  if (drawn_ && drawn_->view == view && same_body(drawn_->style, style)) return drawn_->body;
  drawn_.reset();  // should drawing fail
  prepare_map(style);
  while (masses_.size() < 3) masses_.emplace_back(GL_RGBA32F);
  drawn_ = {view, style, has_columns() ? draw_columns(view, style) : draw_march(view, style)};
  return drawn_->body;
}

void Renderer::draw_absorption(const View& view) {
  absorbed_.resize(view.width, view.height);
  draw_into(absorbed_);
  constexpr float kNothing[4] = {};
  glClearBufferfv(GL_COLOR, 0, kNothing);
  const ScreenBox box = absorbing_.box(view);
  absorbed_.fill(absorbing_.tau(view, box), box.x, box.y, box.width, box.height);
}

void Renderer::draw_opaque(const View& view) {
  shade_.resize(view.width, view.height);
  surface_depth_.resize(view.width, view.height);
  depth_.resize(view.width, view.height);
  draw_into(shade_);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, surface_depth_.texture(), 0);
  attach_depth();
  constexpr GLenum kBoth[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(2, kBoth);
  opaque_.draw_shaded(view, map_ && has_columns() ? DepthMeasure::horizontal : DepthMeasure::along_ray);
}

void Renderer::draw_in_front(const View& view, const Style& style) {
  gl::Target& near = channels() > 1 ? near_masses_ : near_;
  near.resize(view.width, view.height);
  draw_into(near);
  attach_depth();
  constexpr float kNothing[4] = {};
  if (!map_) return glClearBufferfv(GL_COLOR, 0, kNothing);
  const gl::DepthTest test(kOnSurfaces);
  for (int channel = 0; channel < channels(); ++channel) {
    if (channels() > 1) glColorMask(channel == 0, channel == 1, channel == 2, GL_FALSE);
    const bool by_columns = has_columns();
    const gl::Program& in_front = by_columns ? program("near_columns.frag", column_defines(style.sampling))
                                             : program("near_march.frag", march_defines(style.sampling));
    if (by_columns) {
      const RectifiedView upright = rectified_view(view, geometry_, pixels_per_column(style));
      set_columns(in_front, upright);
      in_front.set("from_pixel", upright.from_pixel);
      in_front.set("last_column", upright.columns - 1.0);
    } else {
      set_march(in_front, view);
    }
    map_texels_[channel].bind(in_front, "map_texels", 0);
    surface_depth_.bind(in_front, "surface_depth", 3);
    in_front.set("view_height", double(view.height));
    cover(opaque_.box(view), {0, 0});
  }
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

// ---- the display ----------------------------------------------------------------------------------

std::string Renderer::display_defines(const Style& style, Output output) {
  return output == Output::tau ? "TAU " : style.window.gamma != 1 ? "GAMMA " : "";
}

void Renderer::display_body(const Passes& passes, const Style& style, Output output, glm::ivec2 corner) {
  const auto& [view, body, surfaces] = passes;
  const bool is_absorbing = surfaces == Surfaces::absorbing;
  std::string defines = display_defines(style, output);
  if (is_absorbing) defines += "ABSORBING ";
  if (body.between_columns) defines += "BETWEEN_COLUMNS ";
  const gl::Program& show = program("display.frag", defines);
  body_.bind(show, "body", 0);
  show.set("from_pixel", body.from_pixel);
  show.set("view_height", double(view.height));
  show.set("body_size", glm::dvec2(std::max(1, body.columns), std::max(1, body.rows)));
  show.set("last_quad", quads_of(body.rows) - 1.0);
  show.set("row_limits", glm::dvec2(body.columns > 0 && body.rows > 0 ? body.first_row : 1e9, body.last_row));
  if (is_absorbing) {
    absorbed_.bind(show, "absorbed", 1);
    show.set("weight",
             output == Output::grey && style.full_contrast ? std::max(1.0, style.window.scale) : 1.0);
  }
  set_window(show, style.window);
  show.set("origin", glm::dvec2(corner));
  cover(is_absorbing ? united(body.box, absorbing_.box(view)) : body.box, corner);
}

void Renderer::display_surfaces(const View& view, const Style& style, Output output) {
  std::string defines = display_defines(style, output);
  if (channels() > 1) defines += "SPECTRUM ";
  const gl::Program& show = program("display_surfaces.frag", defines);
  shade_.bind(show, "shade", 0);
  (channels() > 1 ? near_masses_ : near_).bind(show, "near_tau", 1);
  if (channels() > 1) {
    spectrum_table_.bind(show, "spectrum_table", 2);
    show.set("spectrum_bins", spectrum_bins_);
  }
  set_window(show, style.window);
  cover(opaque_.box(view), {0, 0});
}

void Renderer::display(const Passes& passes, const Style& style, Output output, glm::ivec2 corner) {
  const View& view = passes.view;
  glViewport(corner.x, corner.y, view.width, view.height);
  {
    const gl::Scissor scissor(corner.x, corner.y, view.width, view.height);
    const auto nothing = output == Output::grey ? static_cast<float>(style.window.grey(0)) : 0.0f;
    const float colour[4] = {nothing, nothing, nothing, 1};
    glClearBufferfv(GL_COLOR, 0, colour);
  }
  if (passes.surfaces != Surfaces::opaque) return display_body(passes, style, output, corner);
  {
    const gl::DepthTest test(kBesideSurfaces);
    display_body(passes, style, output, corner);
  }
  const gl::DepthTest test(kOnSurfaces);
  display_surfaces(view, style, output);
}

// ---- frames ---------------------------------------------------------------------------------------

Renderer::Passes Renderer::draw_passes(const View& view, const Style& style) {
  Passes passes{view, draw_body(view, style), Surfaces::none};
  if (style.look == Look::surface && !opaque_.empty()) {
    passes.surfaces = Surfaces::opaque;
    draw_opaque(view);
    draw_in_front(view, style);
  } else if (style.look == Look::fluoro && !absorbing_.empty()) {
    passes.surfaces = Surfaces::absorbing;
    draw_absorption(view);
  }
  return passes;
}

Renderer::Passes Renderer::draw_passes(const ProjectionImage& truth) {
  const View& view = truth.view;
  drawn_.reset();
  body_.resize(view.width, quads_of(view.height));
  std::vector<float> quads(static_cast<std::size_t>(4) * body_.width() * body_.height());
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i)
      quads[4 * (static_cast<std::size_t>(j / 4) * body_.width() + i) + j % 4] =
          truth.tau[static_cast<std::size_t>(j) * view.width + i];
  body_.fill(quads, 0, 0, body_.width(), body_.height());
  if (!absorbing_.empty()) draw_absorption(view);
  const Body body{scaled_down(1), {0, 0, view.width, view.height}, view.width, view.height};
  return {view, body, absorbing_.empty() ? Surfaces::none : Surfaces::absorbing};
}

void Renderer::draw_own(const Passes& passes, const Style& style, Output output) {
  gl::Target& frame = output == Output::tau ? frame_tau_ : frame_grey_;
  frame.resize(passes.view.width, passes.view.height);
  draw_into(frame);
  if (passes.surfaces == Surfaces::opaque) attach_depth();
  display(passes, style, output, {0, 0});
}

void Renderer::draw(const View& view, const Style& style, int x, int y) {
  const GLuint framebuffer = bound_framebuffer();
  const Passes passes = draw_passes(view, style);
  if (passes.surfaces != Surfaces::opaque) {
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    return display(passes, style, Output::grey, {x, y});
  }
  // Whose depth buffer says where surfaces are.
  draw_own(passes, style, Output::grey);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer);
  const int right = x + view.width, top = y + view.height;
  glBlitFramebuffer(0, 0, view.width, view.height, x, y, right, top, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
}

void Renderer::draw(const ProjectionImage& truth, const Style& style, int x, int y) {
  const GLuint framebuffer = bound_framebuffer();
  const Passes passes = draw_passes(truth);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  display(passes, style, Output::grey, {x, y});
}

std::vector<float> Renderer::tau(const View& view, const Style& style) {
  return read_tau(draw_passes(view, style), style);
}

std::vector<float> Renderer::body_tau(const View& view, const Style& style) {
  return read_tau({view, draw_body(view, style), Surfaces::none}, style);
}

std::vector<float> Renderer::read_tau(const Passes& passes, const Style& style) {
  const View& view = passes.view;
  draw_own(passes, style, Output::tau);
  std::vector<float> values(static_cast<std::size_t>(view.width) * view.height);
  read_rows(view.width, view.height, GL_RED, GL_FLOAT, values);
  return values;
}

std::vector<std::uint8_t> Renderer::picture(const View& view, const Style& style) {
  draw_own(draw_passes(view, style), style, Output::grey);
  return read_picture(view);
}

std::vector<std::uint8_t> Renderer::picture(const ProjectionImage& truth, const Style& style) {
  draw_own(draw_passes(truth), style, Output::grey);
  return read_picture(truth.view);
}

}  // namespace xraycast
