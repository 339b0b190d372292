#include "xraycast/drawing/grey_picture.hpp"

#include <cstddef>

namespace xraycast {

void GreyPicture::set(std::span<const std::uint8_t> greys, int width, int height) {
  constexpr std::uint32_t kOpaque = 0xFF000000, kThrice = 0x00010101;
  rgba_.resize(greys.size());
  for (std::size_t i = 0; i < greys.size(); ++i) rgba_[i] = kOpaque | kThrice * greys[i];
  glBindTexture(GL_TEXTURE_2D, texture_.id());
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  if (width == width_ && height == height_)
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_INT_8_8_8_8_REV,
                    rgba_.data());
  else
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_INT_8_8_8_8_REV,
                 rgba_.data());
  width_ = width;
  height_ = height;
}

void GreyPicture::draw(int x, int y, int width, int height) const {
  if (width_ == 0) return;
  glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_.id());
  glFramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_.id(), 0);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  // Row 0 is on top, and OpenGL counts from below.
  const bool is_same = width == width_ && height == height_;
  glBlitFramebuffer(0, 0, width_, height_, x, y + height, x + width, y, GL_COLOR_BUFFER_BIT,
                    is_same ? GL_NEAREST : GL_LINEAR);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
}

}  // namespace xraycast
