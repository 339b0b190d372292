#pragma once

#include "xraycast/casting/view.hpp"
#include "xraycast/drawing/gl.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/scene.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// In which way the shaders measure how far along its ray a surface lies.
enum class DepthMeasure {
  horizontal,  ///< s of RectifiedView; under a cone, the horizontal distance from the source
  along_ray,   ///< from the plane of the picture; under a cone, the distance from the source
};

/// Vessels and catheter on the GPU, as opaque surfaces.
class SurfaceLayer {
 public:
  SurfaceLayer();

  /// Surfaces are as `check` accepts them; those with shares are left out.
  void set(std::span<const Surface> surfaces);

  /// Another surface in the place of number `index`, which is at most as large as their count; what moves can
  /// be replaced at every frame.
  void replace(std::size_t index, const Surface& surface);

  bool empty() const;
  std::size_t triangles() const;
  std::size_t size_B() const;

  /// Where a view may show any of them.
  ScreenBox box(const View& view) const;

  /// Draws what is seen into `shade` (RGBA8) and `depth` (R32F) of the bound framebuffer, whose depth buffer
  /// decides, and is all that is cleared: elsewhere both keep what they held.
  void draw_shaded(const View& view, DepthMeasure measure) const;

 private:
  struct Part {
    gl::VertexArray vertices;
    gl::Buffer points, triangles;
    GLsizei indices = 0;
    std::size_t size_B = 0;
    bool is_closed = false;       ///< its back faces are never seen
    GLenum front_faces = GL_CCW;  ///< seen from outside
    glm::dvec3 lower_mm{}, upper_mm{};
    glm::dvec3 colour{};
  };

  void draw(const Part& part) const;

  std::vector<Part> parts_;
  gl::Program shaded_;
};

}  // namespace xraycast
