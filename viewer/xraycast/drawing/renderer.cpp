#include "xraycast/drawing/renderer.hpp"

#include <algorithm>

namespace xraycast {
namespace {

GLuint bound_framebuffer() {
  GLint id = 0;
  glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &id);
  return static_cast<GLuint>(id);
}

/// The bound framebuffer's pixels, flipped from OpenGL's bottom row first to the top row first.
template <typename Value>
void read_rows(int width, int height, GLenum format, GLenum type, std::vector<Value>& values) {
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, format, type, values.data());
  const std::size_t row = values.size() / static_cast<std::size_t>(height);
  for (int j = 0; j < height / 2; ++j)
    std::swap_ranges(&values[j * row], &values[j * row] + row, &values[(height - 1 - j) * row]);
}

/// The bound framebuffer as 8-bit RGB.
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

std::string display_defines(const Style& style, bool is_grey) {
  if (!is_grey) return "TAU ";
  return style.window.gamma != 1 ? "GAMMA " : "";
}

}  // namespace

Renderer::Renderer()
    : body_(screen_),
      shade_(GL_RGBA8),
      surface_depth_(GL_R32F),
      depth_(GL_DEPTH_COMPONENT32F),
      absorbed_(GL_R32F),
      offscreen_tau_(GL_R32F),
      offscreen_grey_(GL_RGBA8) {}

void Renderer::set_surfaces(std::span<const Surface> surfaces) {
  std::ranges::for_each(surfaces, check);
  std::vector<Surface> all = implants_;
  std::ranges::copy(surfaces, std::back_inserter(all));
  opaque_.set(all);
  absorbing_.set(surfaces);
}

void Renderer::set_implants(std::vector<Surface> implants) {
  std::ranges::for_each(implants, check);
  implants_ = std::move(implants);
  absorbing_implants_.set(implants_);
  implant_picture_.reset();
  set_surfaces({});
}

void Renderer::replace_surface(std::size_t index, const Surface& surface) {
  check(surface);
  opaque_.replace(implants_.size() + index, surface);
  absorbing_.replace(index, surface);
}

void Renderer::move_surface(std::size_t index, std::span<const glm::vec3> points_mm) {
  absorbing_.move(index, points_mm);
  opaque_.move(implants_.size() + index, points_mm);
}

// ---- passes ---------------------------------------------------------------------------------------

Renderer::Frame Renderer::draw_passes(const View& view, const Style& style) {
  Frame frame{view, body_.draw(view, style), Surfaces::none};
  if (style.look == Look::surface && !opaque_.empty()) {
    frame.surfaces = Surfaces::opaque;
    draw_opaque(view);
    body_.draw_in_front(view, style, surface_depth_, depth_, opaque_.box(view));
  } else if (style.look == Look::fluoro && absorbs()) {
    frame.surfaces = Surfaces::absorbing;
    draw_absorption(view);
  }
  return frame;
}

Renderer::Frame Renderer::draw_passes(const ProjectionImage& drr) {
  Frame frame{drr.view, body_.draw(drr), Surfaces::none};
  if (absorbs()) {
    frame.surfaces = Surfaces::absorbing;
    draw_absorption(drr.view);
  }
  return frame;
}

void Renderer::draw_absorption(const View& view) {
  absorbed_.resize(view.width, view.height);
  screen_.draw_into(absorbed_);
  constexpr float kNothing[4] = {};
  glClearBufferfv(GL_COLOR, 0, kNothing);
  find_implants(view);
  const ScreenBox &of_implants = implant_picture_->box, box = united(absorbing_.box(view), of_implants);
  std::vector<float> tau = absorbing_.tau(view, box);
  for (int y = 0; y < of_implants.height; ++y) {
    const float* const from = implant_picture_->tau.data() + std::ptrdiff_t{of_implants.width} * y;
    float* const to =
        tau.data() + std::ptrdiff_t{box.width} * (of_implants.y - box.y + y) + (of_implants.x - box.x);
    std::transform(from, from + of_implants.width, to, to, std::plus<>());
  }
  absorbed_box_ = box;
  absorbed_.fill(tau, box.x, box.y, box.width, box.height);
}

void Renderer::find_implants(const View& view) {
  if (implant_picture_ && implant_picture_->view == view) return;
  const ScreenBox box = implants_.empty() ? ScreenBox{} : absorbing_implants_.box(view);
  implant_picture_ = {view, box, absorbing_implants_.tau(view, box)};
}

void Renderer::draw_opaque(const View& view) {
  for (gl::Target* target : {&shade_, &surface_depth_, &depth_}) target->resize(view.width, view.height);
  screen_.draw_into(shade_, surface_depth_);
  screen_.attach_depth(depth_);
  opaque_.draw_shaded(view, body_.depth_measure());
}

// ---- the display ----------------------------------------------------------------------------------

void Renderer::display_body(const Frame& frame, const Style& style, Output output, glm::ivec2 corner) {
  const auto& [view, body, surfaces] = frame;
  const bool is_grey = output == Output::grey, is_absorbing = surfaces == Surfaces::absorbing;
  std::string defines = display_defines(style, is_grey);
  if (is_absorbing) defines += "ABSORBING ";
  if (body.is_resampled) defines += "RESAMPLED ";
  const gl::Program& program = screen_.use("display.frag", defines);
  body_.bind(program, "body", 0);
  program.set("from_pixel", body.from_pixel);
  program.set("view_height", double(view.height));
  program.set("body_size", glm::dvec2(std::max(1, body.columns), std::max(1, body.rows)));
  const int quads = (body.rows + 3) / 4;
  program.set("last_quad", quads - 1.0);
  program.set("row_limits",
              glm::dvec2(body.columns > 0 && body.rows > 0 ? body.first_row : 1e9, body.last_row));
  if (is_absorbing) {
    absorbed_.bind(program, "absorbed", 1);
    program.set("weight", is_grey && style.full_contrast ? std::max(1.0, style.window.scale) : 1.0);
  }
  set_window(program, style.window);
  program.set("origin", glm::dvec2(corner));
  screen_.draw(is_absorbing ? united(body.box, absorbed_box_) : body.box, corner);
}

void Renderer::display_surfaces(const View& view, const Style& style, Output output) {
  std::string defines = display_defines(style, output == Output::grey);
  if (body_.has_spectrum()) defines += "SPECTRUM ";
  const gl::Program& program = screen_.use("display_surfaces.frag", defines);
  shade_.bind(program, "shade", 0);
  body_.bind_in_front(program, "near_tau", 1);
  set_window(program, style.window);
  screen_.draw(opaque_.box(view));
}

void Renderer::display(const Frame& frame, const Style& style, Output output, glm::ivec2 corner) {
  const View& view = frame.view;
  glViewport(corner.x, corner.y, view.width, view.height);
  {
    const gl::Scissor scissor(corner.x, corner.y, view.width, view.height);
    const auto nothing = output == Output::grey ? static_cast<float>(style.window.grey(0)) : 0.0f;
    const float colour[4] = {nothing, nothing, nothing, 1};
    glClearBufferfv(GL_COLOR, 0, colour);
  }
  if (frame.surfaces != Surfaces::opaque) return display_body(frame, style, output, corner);
  {
    const gl::DepthTest test(FullscreenPass::kBesideSurfaces);
    display_body(frame, style, output, corner);
  }
  const gl::DepthTest test(FullscreenPass::kOnSurfaces);
  display_surfaces(view, style, output);
}

/// Displays into a target of ours, with the depth buffer of opaque surfaces.
void Renderer::display_offscreen(const Frame& frame, const Style& style, Output output) {
  gl::Target& target = output == Output::tau ? offscreen_tau_ : offscreen_grey_;
  target.resize(frame.view.width, frame.view.height);
  screen_.draw_into(target);
  if (frame.surfaces == Surfaces::opaque) screen_.attach_depth(depth_);
  display(frame, style, output, {0, 0});
}

// ---- frames ---------------------------------------------------------------------------------------

void Renderer::draw(const View& view, const Style& style, int x, int y) {
  const GLuint framebuffer = bound_framebuffer();
  const Frame frame = draw_passes(view, style);
  if (frame.surfaces != Surfaces::opaque) {
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    return display(frame, style, Output::grey, {x, y});
  }
  // The caller's framebuffer lacks the surfaces' depth.
  display_offscreen(frame, style, Output::grey);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer);
  const int right = x + view.width, top = y + view.height;
  glBlitFramebuffer(0, 0, view.width, view.height, x, y, right, top, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
}

void Renderer::draw(const ProjectionImage& drr, const Style& style, int x, int y) {
  const GLuint framebuffer = bound_framebuffer();
  const Frame frame = draw_passes(drr);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  display(frame, style, Output::grey, {x, y});
}

std::vector<float> Renderer::tau(const View& view, const Style& style) {
  return read_tau(draw_passes(view, style), style);
}

std::vector<float> Renderer::body_tau(const View& view, const Style& style) {
  return read_tau({view, body_.draw(view, style), Surfaces::none}, style);
}

std::vector<float> Renderer::read_tau(const Frame& frame, const Style& style) {
  const View& view = frame.view;
  display_offscreen(frame, style, Output::tau);
  std::vector<float> values(static_cast<std::size_t>(view.width) * view.height);
  read_rows(view.width, view.height, GL_RED, GL_FLOAT, values);
  return values;
}

std::vector<std::uint8_t> Renderer::picture(const View& view, const Style& style) {
  display_offscreen(draw_passes(view, style), style, Output::grey);
  return read_picture(view);
}

std::vector<std::uint8_t> Renderer::picture(const ProjectionImage& drr, const Style& style) {
  display_offscreen(draw_passes(drr), style, Output::grey);
  return read_picture(drr.view);
}

}  // namespace xraycast
