#include "xraycast/scene/stent_surface.hpp"

#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/geometry/tube.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <numbers>

namespace xraycast {
namespace {

double nitinol_per_mm() {
  static const SolidMaterial nitinol{"nitinol", 6.45, {{"Ni", 0.55}, {"Ti", 0.45}}};  // ASTM F2063
  static const double per_mm = fluoroscopy_per_mm(nitinol);
  return per_mm;
}

double cobalt_chromium_per_mm() {
  static const SolidMaterial l605{
      "L-605", 9.1, {{"Co", 0.53}, {"Cr", 0.20}, {"W", 0.15}, {"Ni", 0.10}}};  // ASTM F90
  static const double per_mm = fluoroscopy_per_mm(l605);
  return per_mm;
}

Surface wire_surface(const std::vector<glm::dvec3>& points_mm, const StentModel& stent) {
  constexpr int kSides = 6;
  VesselBranch wire;
  for (const glm::dvec3& point_mm : points_mm) wire.points.push_back({point_mm, 0.5 * stent.strut_mm});
  constexpr glm::dvec3 kColour{0.75, 0.78, 0.82};
  return {.mesh = tube_mesh(VesselTree({wire}, "stent"), kSides),
          .mu_per_mm = stent.expands_itself() ? nitinol_per_mm() : cobalt_chromium_per_mm(),
          .colour = kColour,
          .tube_sides = kSides};
}

/// Of a branch's centreline, which goes on straight beyond its ends.
glm::dvec3 centre_mm(const VesselBranch& branch, double arc_mm) {
  const std::vector<double>& arcs_mm = branch.arc_length_mm;
  const auto beyond = std::lower_bound(arcs_mm.begin() + 1, arcs_mm.end() - 1, arc_mm);
  const auto k = static_cast<std::size_t>(beyond - arcs_mm.begin());
  const double share = (arc_mm - arcs_mm[k - 1]) / (arcs_mm[k] - arcs_mm[k - 1]);
  return glm::mix(branch.points[k - 1].position_mm, branch.points[k].position_mm, share);
}

}  // namespace

std::vector<Surface> stent_surfaces(const StentModel& stent, std::span<const double> radii_mm,
                                    const std::function<glm::dvec3(double beyond_mm)>& axis_mm) {
  // The lower and the upper edge of each ring.
  std::vector<VesselPoint> edges;
  double at_mm = -0.5 * stent.length_of_mm(radii_mm);
  for (const double radius_mm : radii_mm) {
    const double height_mm = stent.ring_height_mm(2 * radius_mm);
    for (const double up_mm : {0.0, height_mm}) edges.push_back({axis_mm(at_mm + up_mm), radius_mm});
    at_mm += height_mm + stent.link_mm;
  }
  const std::vector<Ring> circles = rings_along(edges);
  const int corners = 2 * stent.crowns;
  const auto corner_mm = [&](std::size_t edge, int corner) {
    return circles[edge].at_mm(2 * std::numbers::pi * corner / corners);
  };
  const auto rings = static_cast<int>(radii_mm.size());
  std::vector<Surface> surfaces;
  for (int r = 0; r < rings; ++r) {
    // Every other ring is turned by a strut, so that its crowns meet those of the next.
    const auto lower = 2 * static_cast<std::size_t>(r);
    std::vector<glm::dvec3> ring_mm;
    for (int corner = 0; corner <= corners; ++corner)
      ring_mm.push_back(corner_mm(lower + static_cast<std::size_t>((corner + r) % 2), corner));
    surfaces.push_back(wire_surface(ring_mm, stent));
    if (r + 1 == rings) break;
    for (int link = 0; link < stent.links; ++link) {
      // An upper crown of this ring: where corner + r is odd.
      const int crown = link * stent.crowns / stent.links, corner = 2 * crown + (r % 2 == 0 ? 1 : 0);
      surfaces.push_back(wire_surface({corner_mm(lower + 1, corner), corner_mm(lower + 2, corner)}, stent));
    }
  }
  return surfaces;
}

std::vector<Surface> stent_surfaces(const PlacedStent& stent, const VesselTree& tree) {
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(stent.branch)];
  return stent_surfaces(stent.model, stent.radii_mm,
                        [&](double beyond_mm) { return centre_mm(branch, stent.middle_mm + beyond_mm); });
}

}  // namespace xraycast
