#include "xraycast/drawing/fullscreen_pass.hpp"

namespace xraycast {
namespace {

void attach(GLenum attachment, GLuint texture) {
  glFramebufferTexture2D(GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, texture, 0);
}

}  // namespace

const gl::Program& FullscreenPass::use(const std::string& fragment, const std::string& defines) {
  const auto [entry, is_new] =
      programs_.try_emplace(fragment + ' ' + defines, "screen.vert", fragment, defines);
  entry->second.use();
  return entry->second;
}

void FullscreenPass::draw_into(const gl::Target& target) {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  attach(GL_COLOR_ATTACHMENT0, target.texture());
  attach(GL_COLOR_ATTACHMENT1, 0);
  attach(GL_DEPTH_ATTACHMENT, 0);
  constexpr GLenum kFirst = GL_COLOR_ATTACHMENT0;
  glDrawBuffers(1, &kFirst);
  glViewport(0, 0, target.width(), target.height());
}

void FullscreenPass::draw_into(const gl::Target& first, const gl::Target& second) {
  draw_into(first);
  attach(GL_COLOR_ATTACHMENT1, second.texture());
  constexpr GLenum kBoth[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(2, kBoth);
}

void FullscreenPass::attach_depth(const gl::Target& depth) { attach(GL_DEPTH_ATTACHMENT, depth.texture()); }

void FullscreenPass::draw() const {
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void FullscreenPass::draw(const ScreenBox& box, glm::ivec2 corner) const {
  const gl::Scissor scissor(corner.x + box.x, corner.y + box.y, box.width, box.height);
  draw();
}

}  // namespace xraycast
