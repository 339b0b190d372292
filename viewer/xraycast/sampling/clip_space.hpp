#pragma once

#include "xraycast/projection/view.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <glm/mat4x4.hpp>

#include <array>
#include <span>

namespace xraycast {

/// A view's projection matrix: LPS millimetres to clip space. The depth order runs from the detector, also
/// under a cone, whose centre of projection is on the other side.
glm::dmat4 to_clip(const View& view);

/// Projects a point to pixels from the picture's upper left corner.
glm::dvec2 pixel_of(const View& view, const glm::dvec3& point_mm);

/// A rectangle of whole pixels, counted from the picture's lower left corner as OpenGL does.
struct ScreenBox {
  int x = 0, y = 0, width = 0, height = 0;
  bool operator==(const ScreenBox&) const = default;
};

/// The bounding box of both; an empty one adds nothing.
ScreenBox united(const ScreenBox& a, const ScreenBox& b);

/// The bounding box of a convex body with these corners in a view, with a margin of a pixel; all pixels when
/// a corner is beside or behind a cone's source.
ScreenBox screen_box(const View& view, std::span<const glm::dvec3> corners_mm);

/// The corners of a box around bounds that faces the view.
std::array<glm::dvec3, 8> corners_mm(const BodyBounds& bounds, const View& view);

/// The box between two opposite corners.
std::array<glm::dvec3, 8> corners_mm(const glm::dvec3& lower_mm, const glm::dvec3& upper_mm);

}  // namespace xraycast
