#include "xraycast/scene/catheter_surface.hpp"

#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/geometry/tube.hpp"
#include "xraycast/scene/device_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/scene/vessels.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <string>
#include <utility>

namespace xraycast {
namespace {

// A core of steel of two thirds of the wire's diameter.
double wire_per_mm() {
  constexpr double kSteel_mg_ml = 7900, kCore = 4.0 / 9;
  static const double per_mm = fluoroscopy_per_mm("Fe", kSteel_mg_ml * kCore);
  return per_mm;
}

double marker_per_mm(const std::string& material) {
  static const std::map<std::string, double> per_mm = [] {
    std::map<std::string, double> known;
    for (const std::string& name : marker_materials()) known[name] = fluoroscopy_per_mm(solid_named(name));
    return known;
  }();
  return per_mm.at(material);
}

void add_ring(const Ring& circle, double radius_mm, std::vector<glm::vec3>& points_mm) {
  Ring ring = circle;
  ring.radius_mm = radius_mm;
  for (int i = 0; i < kBandSides; ++i)
    points_mm.emplace_back(ring.at_mm(2 * std::numbers::pi * i / kBandSides));
}

InstrumentPart marker_part(std::vector<glm::dvec3> nodes_mm, const MarkerModel& marker, double radius_mm) {
  return {std::move(nodes_mm), std::max(0.0, radius_mm - marker.thickness_mm), marker_per_mm(marker.material),
          kMarkerColour};
}

Surface band_surface(const InstrumentPart& part, double radius_mm) {
  if (part.nodes_mm.size() < kFewestNodes) return {};
  return {.mesh = band_mesh(curve_through(part.nodes_mm), radius_mm, part.inner_radius_mm),
          .mu_weights = {},
          .tube_sides = kBandSides};
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

Mesh band_mesh(const NurbsCurve& curve, double radius_mm, double inner_radius_mm) {
  constexpr int kBandRingsPerNode = 2;
  const int steps = kBandRingsPerNode * static_cast<int>(curve.points().size() - 1);
  std::vector<VesselPoint> line;
  for (int k = 0; k <= steps; ++k)
    line.push_back(
        {curve.at_mm(std::lerp(curve.knots().front(), curve.knots().back(), static_cast<double>(k) / steps)),
         radius_mm});
  const std::vector<Ring> circles = rings_along(line);
  Mesh mesh;
  mesh.points_mm.emplace_back(line.front().position_mm);
  for (const Ring& circle : circles) add_ring(circle, radius_mm, mesh.points_mm);
  std::for_each(circles.rbegin(), circles.rend(),
                [&](const Ring& circle) { add_ring(circle, inner_radius_mm, mesh.points_mm); });
  mesh.points_mm.push_back(mesh.points_mm.front());
  const auto rings = static_cast<std::uint32_t>(2 * circles.size());
  constexpr auto kCorners = static_cast<std::uint32_t>(kBandSides);
  for (std::uint32_t ring = 0; ring < rings; ++ring)
    for (std::uint32_t i = 0; i < kCorners; ++i) {
      const std::uint32_t next = (i + 1) % kCorners, below = 1 + ring * kCorners,
                          above = 1 + (ring + 1) % rings * kCorners;
      mesh.triangles.push_back({below + i, below + next, above + next});
      mesh.triangles.push_back({below + i, above + next, above + i});
    }
  return mesh;
}

SteeredInstruments::Instrument drawn(const InstrumentModel& model, std::vector<glm::dvec3> nodes_mm) {
  return {.nodes_mm = std::move(nodes_mm),
          .radius_mm = model.radius_mm(),
          .has_lumen = model.inner_radius_mm() > 0,
          .markers = model.markers()};
}

std::vector<Surface> instrument_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                         const InstrumentModel& instrument, const TreatingView& view) {
  std::vector<Surface> surfaces = instrument_surfaces(drawn(instrument, nodes_mm));
  for (Surface& surface : device_surfaces(treating_tubes(nodes_mm, instrument, view)))
    surfaces.push_back(std::move(surface));
  return surfaces;
}

std::vector<InstrumentPart> instrument_parts(const SteeredInstruments::Instrument& instrument) {
  std::vector<std::vector<glm::dvec3>> lengths_mm = lengths_of(instrument.nodes_mm, instrument.markers);
  std::vector<InstrumentPart> parts{{std::move(lengths_mm[0]), 0,
                                     instrument.has_lumen ? catheter_per_mm() : wire_per_mm(),
                                     kCatheterColour}};
  for (std::size_t m = 0; m < instrument.markers.size(); ++m)
    parts.push_back(marker_part(std::move(lengths_mm[1 + m]), instrument.markers[m], instrument.radius_mm));
  return parts;
}

std::vector<Surface> instrument_surfaces(const SteeredInstruments::Instrument& instrument) {
  std::vector<Surface> surfaces;
  for (const InstrumentPart& part : instrument_parts(instrument)) {
    const bool is_tube = surfaces.empty();
    Surface& surface = surfaces.emplace_back(is_tube ? catheter_surface(part.nodes_mm, instrument.radius_mm)
                                                     : band_surface(part, instrument.radius_mm));
    surface.mu_per_mm = part.mu_per_mm;
    surface.colour = part.colour;
  }
  return surfaces;
}

std::vector<Surface> steered_surfaces(const SteeredInstruments& steered) {
  std::vector<Surface> surfaces;
  for (const SteeredInstruments::Instrument& instrument : steered.instruments)
    for (Surface& surface : instrument_surfaces(instrument)) surfaces.push_back(std::move(surface));
  return surfaces;
}

}  // namespace xraycast
