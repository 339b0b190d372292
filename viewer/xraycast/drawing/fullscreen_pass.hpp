#pragma once

#include "xraycast/drawing/gl.hpp"
#include "xraycast/sampling/clip_space.hpp"

#include <glm/vec2.hpp>

#include <map>
#include <string>

namespace xraycast {

/// Runs fragment shaders over the pixels of a target, by a triangle that covers it. Owns the framebuffer that
/// targets are attached to, and the programs, each compiled at its first use.
class FullscreenPass {
 public:
  /// The triangle lies behind all surfaces, at the depth to which buffers are cleared. So a depth test
  /// against it separates pixels with opaque surfaces from those without.
  static constexpr GLenum kOnSurfaces = GL_GREATER, kBesideSurfaces = GL_EQUAL;

  /// A fragment shader of viewer/shaders, compiled with `defines` (see gl::Program), as the current program.
  const gl::Program& use(const std::string& fragment, const std::string& defines);

  /// Binds the framebuffer with one target, or with two, and a viewport as large as the first.
  void draw_into(const gl::Target& target);
  void draw_into(const gl::Target& first, const gl::Target& second);

  /// A depth buffer for the targets, as large as they are.
  void attach_depth(const gl::Target& depth);

  /// Shades all pixels of the viewport, or those of a box relative to `corner`.
  void draw() const;
  void draw(const ScreenBox& box, glm::ivec2 corner = {0, 0}) const;

 private:
  std::map<std::string, gl::Program> programs_;
  gl::VertexArray no_vertices_;
  gl::Framebuffer framebuffer_;
};

}  // namespace xraycast
