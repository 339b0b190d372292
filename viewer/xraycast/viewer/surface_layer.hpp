#pragma once

#include "xraycast/view.hpp"
#include "xraycast/viewer/gl.hpp"
#include "xraycast/viewer/scene.hpp"

#include <glm/mat4x4.hpp>

#include <span>
#include <vector>

namespace xraycast {

/// A view's projection for OpenGL: LPS millimetres to clip space. What is nearer to the detector is in front,
/// also under a cone, whose rays come from the other side.
glm::dmat4 to_clip(const View& view);

/// In which way the shaders measure how far along its ray a surface lies.
enum class DepthMeasure {
  horizontal,  ///< s of UprightView; under a cone, the horizontal distance from the source
  along_ray,   ///< from the plane of the picture; under a cone, the distance from the source
};

/// Vessels and catheter on the GPU.
class SurfaceLayer {
 public:
  SurfaceLayer();

  /// Throws InputError when a surface has points that are not finite.
  void set(std::span<const Surface> surfaces);

  bool empty() const { return parts_.empty(); }
  std::size_t triangles() const;
  std::size_t size_B() const;

  /// Draws what is seen into `shade` (RGBA8; alpha 1 where there is a surface) and `depth` (R32F) of the
  /// bound framebuffer, whose depth buffer decides.
  void draw_shaded(const View& view, DepthMeasure measure) const;

  /// Adds up what is absorbed in the bound framebuffer's one R32F target.
  void draw_absorption(const View& view) const;

 private:
  struct Part {
    gl::VertexArray vertices;
    gl::Buffer points, triangles;
    GLsizei indices = 0;
    std::size_t size_B = 0;
    double mu_per_mm = 0;
    glm::dvec3 colour{};
  };

  std::vector<Part> parts_;
  gl::Program shaded_, absorption_;
};

}  // namespace xraycast
