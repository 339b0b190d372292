#pragma once

#include "xraycast/casting/view.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/scene.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// Vessels and catheter as what they absorb, on the processor and without OpenGL.
///
/// Along a ray what absorbs most counts, once: surfaces that cross, enclose or touch each other, or
/// themselves, hold their union, and a catheter displaces the blood. A ray is within a surface where it has
/// entered more often than left (a winding number above zero). So the places of all entries and exits are
/// kept, pixel by pixel, and sorted, as in an A-buffer (Carpenter, Computer Graphics 18(3):103, 1984); sums
/// of the exits' depths minus the entries', which need no order, count twice where surfaces overlap.
class AbsorbingSurfaces {
 public:
  /// Surfaces are as `check` accepts them.
  void set(std::span<const Surface> surfaces);

  /// Another surface in the place of number `index`, which is at most as large as their count.
  void replace(std::size_t index, const Surface& surface);

  bool empty() const;

  /// Where a view may show any of them.
  ScreenBox box(const View& view) const;

  /// Optical depth of a view's rays in that part of its picture: height x width, the lowest row first, as
  /// OpenGL counts. Triangles that reach behind a cone's source are not seen.
  std::vector<float> tau(const View& view, const ScreenBox& part) const;

 private:
  struct Part {
    Surface surface;
    bool is_inside_out = false;  ///< its triangles look inwards
    glm::dvec3 lower_mm{}, upper_mm{};
  };
  std::vector<Part> parts_;
};

}  // namespace xraycast
