#pragma once

#include "xraycast/drawing/gl.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/thin_tube.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// How the shaders measure the depth of a surface along its ray.
enum class DepthMeasure {
  horizontal,  ///< s of RectifiedView; under a cone, the horizontal distance from the source
  along_ray,   ///< from the plane of the picture; under a cone, the distance from the source
};

/// Vessels and catheter on the GPU, as opaque surfaces.
class SurfaceLayer {
 public:
  SurfaceLayer();

  /// Surfaces are as `check` accepts them; those with weights are left out.
  void set(std::span<const Surface> surfaces);

  /// Replaces surface `index`, or appends one if `index` is their count; moving surfaces are replaced every
  /// frame.
  void replace(std::size_t index, const Surface& surface);

  /// Moves the points of surface `index`, one for one; what is outside stays there.
  void move(std::size_t index, std::span<const glm::vec3> points_mm);

  bool empty() const;

  /// The bounding box of all surfaces in a view.
  ScreenBox box(const View& view) const;

  /// Draws the visible surfaces into `shade` (RGBA8) and `depth` (R32F) of the bound framebuffer, by its
  /// depth buffer; only that is cleared: elsewhere both targets keep their contents.
  void draw_shaded(const View& view, DepthMeasure measure) const;

 private:
  struct Part {
    gl::VertexArray vertices;
    gl::Buffer points, triangles;
    GLsizei indices = 0;
    bool is_closed = false;       ///< its back faces are culled
    GLenum front_faces = GL_CCW;  ///< seen from outside
    glm::dvec3 lower_mm{}, upper_mm{};
    glm::dvec3 colour{};
    Tube tube{};
    Surface surface{};  ///< without its mesh where it is left out
  };

  static void place(Part& part);

  void draw(const Part& part) const;

  std::vector<Part> parts_;
  gl::Program shaded_;
};

}  // namespace xraycast
