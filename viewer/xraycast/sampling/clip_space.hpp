#pragma once

#include "xraycast/casting/view.hpp"
#include "xraycast/sampling/camera.hpp"

#include <glm/mat4x4.hpp>

#include <array>
#include <span>

namespace xraycast {

/// A view's projection for OpenGL: LPS millimetres to clip space. What is nearer to the detector is in front,
/// also under a cone, whose rays come from the other side.
glm::dmat4 to_clip(const View& view);

/// Where a point is seen, in pixels from the picture's upper left corner.
glm::dvec2 pixel_of(const View& view, const glm::dvec3& point_mm);

/// A part of a picture in whole pixels, counted from its lower left corner as OpenGL does.
struct ScreenBox {
  int x = 0, y = 0, width = 0, height = 0;
  bool operator==(const ScreenBox&) const = default;
};

/// What holds both boxes; an empty one adds nothing.
ScreenBox united(const ScreenBox& a, const ScreenBox& b);

/// The pixels of a view on which a convex body with these corners can be seen, and one more on each side;
/// all of them when a corner is beside or behind a cone's source.
ScreenBox screen_box(const View& view, std::span<const glm::dvec3> corners_mm);

/// A box around bounds, turned to face the view.
std::array<glm::dvec3, 8> corners_mm(const BodyBounds& bounds, const View& view);

/// The box between two opposite corners.
std::array<glm::dvec3, 8> corners_mm(const glm::dvec3& lower_mm, const glm::dvec3& upper_mm);

}  // namespace xraycast
