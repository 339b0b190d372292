#include "xraycast/scene/catheter_surface.hpp"

#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/scene/vessels.hpp"

#include <utility>

namespace xraycast {
namespace {

// A core of steel of two thirds of the wire's diameter, and around the tip a coil of platinum that fills a
// quarter of the cross-section, as wires of 0.014 to 0.035 inch have them.
double wire_per_mm() {
  constexpr double kSteel_mg_ml = 7900, kCore = 4.0 / 9;
  static const double per_mm = fluoroscopy_per_mm("Fe", kSteel_mg_ml * kCore);
  return per_mm;
}
double wire_tip_per_mm() {
  constexpr double kPlatinum_mg_ml = 21450, kCoil = 0.25;
  static const double per_mm = fluoroscopy_per_mm("Pt", kPlatinum_mg_ml * kCoil);
  return per_mm;
}

}  // namespace

Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm) {
  if (nodes_mm.size() < kFewestNodes) return {};
  // No smoother than is seen at a catheter's width: the mesh is rebuilt for every frame.
  constexpr int kRingsPerNode = 3, kSides = 8;
  return {tube_mesh(curve_through(nodes_mm), radius_mm, kRingsPerNode, kSides),
          catheter_per_mm(),
          kCatheterColour,
          {},
          kSides};
}

std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                         const InstrumentModel& instrument, const BalloonView& balloon) {
  std::vector<Surface> surfaces =
      instrument_surfaces(nodes_mm, instrument.radius_mm(), instrument.inner_radius_mm() > 0);
  for (Surface& surface : balloon_surfaces(nodes_mm, instrument, balloon))
    surfaces.push_back(std::move(surface));
  return surfaces;
}

std::vector<InstrumentPart> instrument_parts(const std::vector<glm::dvec3>& nodes_mm, bool has_lumen) {
  std::vector<std::vector<glm::dvec3>> lengths_mm = lengths_of(nodes_mm, has_lumen);
  if (has_lumen) return {{std::move(lengths_mm[0]), catheter_per_mm(), kCatheterColour}};
  constexpr glm::dvec3 kTipColour{0.95, 0.8, 0.35};
  return {{std::move(lengths_mm[0]), wire_per_mm(), kCatheterColour},
          {std::move(lengths_mm[1]), wire_per_mm() + wire_tip_per_mm(), kTipColour}};
}

std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm, double radius_mm,
                                         bool has_lumen) {
  std::vector<Surface> surfaces;
  for (const InstrumentPart& part : instrument_parts(nodes_mm, has_lumen)) {
    Surface& surface = surfaces.emplace_back(catheter_surface(part.nodes_mm, radius_mm));
    surface.mu_per_mm = part.mu_per_mm;
    surface.colour = part.colour;
  }
  return surfaces;
}

std::vector<Surface> steered_surfaces(const SteeredInstruments& steered) {
  std::vector<Surface> surfaces;
  for (const auto& [nodes_mm, radius_mm, has_lumen] : steered.instruments)
    for (Surface& surface : instrument_surfaces(nodes_mm, radius_mm, has_lumen))
      surfaces.push_back(std::move(surface));
  return surfaces;
}

}  // namespace xraycast
