#pragma once

#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// A balloon as it is: its pressure, and whether its stent is on it still.
struct BalloonView {
  double bar = 0;
  bool carries_stent = false;
};

/// The balloon of an instrument along its nodes, filled with contrast agent that is diluted by half, which
/// has no points while it is folded; and the stent that it carries (see stent_surfaces). Nothing for an
/// instrument without one.
std::vector<Surface> balloon_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                      const InstrumentModel& instrument, const BalloonView& view);

}  // namespace xraycast
