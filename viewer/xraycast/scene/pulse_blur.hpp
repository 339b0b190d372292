#pragma once

#include "xraycast/projection/view.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <span>
#include <vector>

namespace xraycast {

/// How a pulse of X-rays sees attenuating surfaces that move while it lasts: as they are in the middles of
/// its thirds. The mean of what the three transmit is that of a steady motion over the pulse, to a third of
/// its way.
///
/// The map needs none of it: between its keys it is linear in the phase, so that its mean over a pulse is the
/// map in the pulse's middle.
struct PulseBlur {
  double pulse_s = 0;   ///< 0: none
  double pixel_mm = 0;  ///< at the C-arm's axis

  bool is_on() const { return pulse_s > 0; }

  /// The first and the last of the three instants come so long before and after the middle.
  double from_middle_s() const { return pulse_s / 3; }
};

/// A view's pixel where the axis is.
double pixel_at_axis_mm(const View& view);

/// Points that move steadily, from where they were some time before, at another time from now on. The same
/// points where their number has changed.
std::vector<glm::dvec3> moved_on(std::span<const glm::dvec3> points_mm, std::span<const glm::dvec3> before_mm,
                                 double passed_s, double later_s);

/// Surfaces as a pulse sees them, of those at the three instants, one for one: three times as many, each with
/// its step of the pulse. A surface of which no point moves by more than half a pixel from the first to the
/// last instant is there during the whole pulse as it is in its middle, and the other two are empty.
std::vector<Surface> seen_by_pulse(std::vector<Surface> first, std::vector<Surface> middle,
                                   std::vector<Surface> last, double pixel_mm);

}  // namespace xraycast
