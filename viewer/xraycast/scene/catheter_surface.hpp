#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/geometry/nurbs_curve.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/session_file.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// The clamped cubic through an instrument's nodes (four or more; see NurbsCurve::cubic), by progressive
/// iteration (Lin, Bao and Wang, Totally positive bases and progressive iteration approximation, 2005).
NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm);

/// A simulated catheter's surface, a tube about the curve through its nodes; nothing for fewer than four.
Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm);

/// A length of an instrument that is of one material.
struct InstrumentPart {
  std::vector<glm::dvec3> nodes_mm;
  double mu_per_mm;
  glm::dvec3 colour;
};

/// A catheter is one part. A guide wire, which has no lumen, has two, also where one of them has no nodes:
/// its steel core, and its tip of kWireTip_mm, which is denser.
std::vector<InstrumentPart> instrument_parts(const std::vector<glm::dvec3>& nodes_mm, bool has_lumen);

/// The surfaces of an instrument, one a part.
std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm, double radius_mm,
                                         bool has_lumen);
std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                         const InstrumentModel& instrument);
inline constexpr double kWireTip_mm = 30;

/// The surfaces of all instruments of a session.
std::vector<Surface> steered_surfaces(const SteeredInstruments& steered);

/// The place where contrast agent leaves a catheter, as a location in its vessel tree.
VesselTree::Location place_of(const InstrumentTip& tip);

}  // namespace xraycast
