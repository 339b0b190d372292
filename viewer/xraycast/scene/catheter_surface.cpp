#include "xraycast/scene/catheter_surface.hpp"

#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/vessels.hpp"

#include <glm/geometric.hpp>

namespace xraycast {
namespace {

constexpr std::size_t kFewest = 4;  // nodes of a cubic

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

/// The first node of a wire's tip; 0 where what is left of the shaft is too short to be drawn.
std::size_t tip_begin(const std::vector<glm::dvec3>& nodes_mm) {
  double length_mm = 0;
  std::size_t first = nodes_mm.size();
  while (first > 1 && length_mm < kWireTip_mm) {
    --first;
    length_mm += glm::distance(nodes_mm[first - 1], nodes_mm[first]);
  }
  return first < kFewest ? 0 : first - 1;
}

}  // namespace

NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm) {
  // The parameter at which each control point has most weight: its Greville abscissa, the mean of its three
  // inner knots.
  const NurbsCurve first = NurbsCurve::cubic(nodes_mm, "catheter");
  std::vector<double> greville;
  for (std::size_t i = 0; i < nodes_mm.size(); ++i)
    greville.push_back((first.knots()[i + 1] + first.knots()[i + 2] + first.knots()[i + 3]) / 3);
  std::vector<glm::dvec3> controls = nodes_mm;
  // Each iteration leaves a third of the distance or less.
  constexpr int kIterations = 8;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const NurbsCurve curve = NurbsCurve::cubic(controls, "catheter");
    for (std::size_t i = 0; i < controls.size(); ++i) controls[i] += nodes_mm[i] - curve.at_mm(greville[i]);
  }
  return NurbsCurve::cubic(controls, "catheter");
}

Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm) {
  if (nodes_mm.size() < kFewest) return {};
  // No smoother than is seen at a catheter's width: the mesh is rebuilt for every frame.
  constexpr int kRingsPerNode = 3, kSides = 8;
  return {tube_mesh(curve_through(nodes_mm), radius_mm, kRingsPerNode, kSides),
          catheter_per_mm(),
          kCatheterColour,
          {},
          kSides};
}

std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                         const InstrumentModel& instrument) {
  return instrument_surfaces(nodes_mm, instrument.radius_mm(), instrument.inner_radius_mm() > 0);
}

std::vector<InstrumentPart> instrument_parts(const std::vector<glm::dvec3>& nodes_mm, bool has_lumen) {
  if (has_lumen) return {{nodes_mm, catheter_per_mm(), kCatheterColour}};
  constexpr glm::dvec3 kTipColour{0.95, 0.8, 0.35};
  const auto tip = nodes_mm.begin() + static_cast<std::ptrdiff_t>(tip_begin(nodes_mm));
  // They share the node between them.
  const std::vector<glm::dvec3> of_shaft(nodes_mm.begin(), tip == nodes_mm.begin() ? tip : tip + 1);
  return {{of_shaft, wire_per_mm(), kCatheterColour},
          {{tip, nodes_mm.end()}, wire_per_mm() + wire_tip_per_mm(), kTipColour}};
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

VesselTree::Location place_of(const InstrumentTip& tip) {
  VesselTree::Location place;
  place.branch = tip.branch;
  place.arc_length_mm = tip.arc_length_mm;
  return place;
}

}  // namespace xraycast
