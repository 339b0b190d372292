#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/geometry/nurbs_curve.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/device_tubes.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/session_file.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// A simulated catheter's surface, a tube about the curve through its nodes; nothing for fewer than four.
Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm);

/// A marker's band: the wall between two radii about a curve, with flat ends. Its points are a tube's of
/// kBandSides (see Surface), but its poles lie in the middle of its first end, and no triangle has them.
Mesh band_mesh(const NurbsCurve& curve, double radius_mm, double inner_radius_mm);
/// Flat sides are nearer to the axis by a fiftieth at most, and so is the wall thinner.
inline constexpr int kBandSides = 16;
inline constexpr glm::dvec3 kMarkerColour{0.95, 0.8, 0.35};

/// How an instrument of a model is drawn.
SteeredInstruments::Instrument drawn(const InstrumentModel& model, std::vector<glm::dvec3> nodes_mm = {});

/// A length of an instrument that is of one material.
struct InstrumentPart {
  std::vector<glm::dvec3> nodes_mm;
  double inner_radius_mm;  ///< of a band; 0: a tube
  double mu_per_mm;
  glm::dvec3 colour;
};

/// Of each of lengths_of(): a catheter's tubing or a wire's steel core, and its markers.
std::vector<InstrumentPart> instrument_parts(const SteeredInstruments::Instrument& instrument);

/// The surfaces of an instrument, one a part.
std::vector<Surface> instrument_surfaces(const SteeredInstruments::Instrument& instrument);
/// And those of its balloon and stent (see treating_tubes).
std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                         const InstrumentModel& instrument, const TreatingView& view = {});

/// The surfaces of all instruments of a session.
std::vector<Surface> steered_surfaces(const SteeredInstruments& steered);

}  // namespace xraycast
