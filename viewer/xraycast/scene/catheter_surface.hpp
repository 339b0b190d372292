#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/balloon_surface.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/session_file.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// A simulated catheter's surface, a tube about the curve through its nodes; nothing for fewer than four.
Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm);

/// A length of an instrument that is of one material.
struct InstrumentPart {
  std::vector<glm::dvec3> nodes_mm;
  double mu_per_mm;
  glm::dvec3 colour;
};

/// Of each of lengths_of(): a catheter, or a wire's steel core and its tip, which is denser.
std::vector<InstrumentPart> instrument_parts(const std::vector<glm::dvec3>& nodes_mm, bool has_lumen);

/// The surfaces of an instrument, one a part.
std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm, double radius_mm,
                                         bool has_lumen);
/// And those of its balloon (see balloon_surfaces).
std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                         const InstrumentModel& instrument, const BalloonView& balloon = {});

/// The surfaces of all instruments of a session.
std::vector<Surface> steered_surfaces(const SteeredInstruments& steered);

}  // namespace xraycast
