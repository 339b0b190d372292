#pragma once

#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// Balloon and stent of an instrument as they are: the pressure, the rings of the stent that are on it still,
/// and how far a sheath is drawn back.
struct TreatingView {
  double bar = 0;
  int carried_rings = 0;
  double release_mm = 0;
};

/// The balloon of an instrument along its nodes, filled with contrast agent that is diluted by half, which
/// has no points while it is folded; and the stent that it carries (see stent_surfaces). Of a stent in a
/// sheath the marker at the sheath's tip, which moves with it, and the rings that are in it. Nothing for an
/// instrument without either.
std::vector<Surface> treating_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                       const InstrumentModel& instrument, const TreatingView& view);

}  // namespace xraycast
