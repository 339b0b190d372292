#pragma once

#include "xraycast/projection/view.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/thin_tube.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// The attenuation of vessels and catheter, computed on the processor and without OpenGL.
///
/// At every point of a ray only the largest mu counts: surfaces that intersect, enclose or touch each other,
/// or themselves, represent their union, and a catheter displaces the blood. A ray is within a surface where
/// it has entered more often than left (a winding number above zero). Hence the depths of all entries and
/// exits are collected per pixel and sorted, as in an A-buffer (Carpenter, Computer Graphics 18(3):103,
/// 1984); sums of the exits' depths minus the entries', which need no order, would count overlaps twice.
///
/// Where surfaces are there during some steps of a pulse alone, the picture is the mean of what each step
/// transmits.
///
/// A tube that is thinner than a pixel is drawn wider than it is (thin_tube.hpp): its matter displaces only
/// its share of what is there.
class AbsorbingSurfaces {
 public:
  /// Surfaces are as `check` accepts them.
  void set(std::span<const Surface> surfaces);

  /// Replaces surface `index`, or appends one where `index` is their count.
  void replace(std::size_t index, const Surface& surface);

  /// Moves the points of surface `index`, one for one, as a body in motion does; what is outside stays there.
  /// Throws InputError for another number of points.
  void move(std::size_t index, std::span<const glm::vec3> points_mm);

  bool empty() const;

  /// The bounding box of all surfaces in a view.
  ScreenBox box(const View& view) const;

  /// Optical depth of a view's rays in that part of its picture: height x width, the lowest row first, as
  /// OpenGL counts. Triangles that reach behind a cone's source are dropped.
  std::vector<float> tau(const View& view, const ScreenBox& part) const;

  /// Adds it to optical depths of the whole picture: height x width, row 0 on top.
  void add_to(std::span<float> tau, const View& view) const;

 private:
  struct Part {
    Surface surface;
    bool is_inside_out = false;  ///< its normals point inwards
    glm::dvec3 lower_mm{}, upper_mm{};
    Tube tube{};
  };
  static void measure(Part& part);

  std::vector<Part> parts_;
};

}  // namespace xraycast
