#pragma once

#include "xraycast/projection/view.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// An instrument thinner than a pixel, as a detector sees it: it darkens the pixel by its share of it. Rays
/// through the middles of pixels would mostly miss it. Hence a tube is drawn at least kLeastRadius_pixels
/// thick, and the matter in it is thinned, so that what it absorbs across stays the same.
///
/// Half a pixel is too thin: a tube's sides are flat, and near its outline a ray's chord is short. At this
/// radius the rays of every row across a tube (of every column, if it lies flat) find 0.75 to 1.4 times what
/// it absorbs, for any place, direction and roll; at 0.55 pixels 0.56 times, and below 0.54 nothing.
inline constexpr double kLeastRadius_pixels = 0.61;

/// A surface's tube_sides, and what follows from them; no sides where it is no tube.
struct Tube {
  int sides = 0;
  double radius_mm = 0;
  std::vector<glm::vec3> from_axis_mm{};  ///< every point from the middle of its ring, poles from themselves
};
Tube tube_of(const Surface& surface);

/// How a tube is drawn in a view.
struct Widening {
  double factor = 1;    ///< by which its points move away from the axis
  double thinness = 0;  ///< 1 up to the least radius, 0 from twice that on
  double share = 1;     ///< of the drawn tube that its matter fills; up to 1.11 where flat sides lack it
};

/// Of a tube with points within a box. Under a cone the pixels are those at the box's farthest corner from
/// the source, where they are largest.
Widening widening_of(const Tube& tube, const glm::dvec3& lower_mm, const glm::dvec3& upper_mm,
                     const View& view);

/// The points of a tube's mesh as they are drawn, where it is widened.
std::vector<glm::vec3> widened(const std::vector<glm::vec3>& points_mm, const Tube& tube,
                               const Widening& widening);

/// What it covers of a picture then, with a margin (see screen_box); also for a surface that is no tube.
ScreenBox drawn_box(const Tube& tube, const glm::dvec3& lower_mm, const glm::dvec3& upper_mm,
                    const View& view);

}  // namespace xraycast
