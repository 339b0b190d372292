#pragma once

#include "xraycast/drawing/gl.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// Draws a greyscale picture that was computed elsewhere, unchanged. Needs a current OpenGL context.
class GreyPicture {
 public:
  /// Replaces it: 8-bit greys, width x height, row 0 on top.
  void set(std::span<const std::uint8_t> greys, int width, int height);

  /// Fills a rectangle of the default framebuffer, from its lower left corner on; nothing before `set`.
  void draw(int x, int y, int width, int height) const;

 private:
  gl::Texture texture_;
  gl::Framebuffer framebuffer_;
  std::vector<std::uint32_t> rgba_;
  int width_ = 0, height_ = 0;
};

}  // namespace xraycast
