#include "xraycast/scene/device_surface.hpp"

#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/instrument_curve.hpp"

#include <array>
#include <cstddef>

namespace xraycast {
namespace {

std::array<DeviceMaterial, kDeviceMatters> all_materials() {
  constexpr double kFilled_mg_ml = 150;
  constexpr glm::dvec3 kFilledColour{0.85, 0.85, 0.9}, kStrutColour{0.75, 0.78, 0.82};
  constexpr int kBalloonSides = 24, kStrutSides = 6;
  const SolidMaterial nitinol{"nitinol", 6.45, {{"Ni", 0.55}, {"Ti", 0.45}}};  // ASTM F2063
  const SolidMaterial l605{
      "L-605", 9.1, {{"Co", 0.53}, {"Cr", 0.20}, {"W", 0.15}, {"Ni", 0.10}}};  // ASTM F90
  return {{{fluoroscopy_per_mm("I", kFilled_mg_ml), kFilledColour, kBalloonSides},
           {fluoroscopy_per_mm(l605), kStrutColour, kStrutSides},
           {fluoroscopy_per_mm(nitinol), kStrutColour, kStrutSides},
           {fluoroscopy_per_mm(solid_named("platinum")), kMarkerColour, kBandSides}}};
}

Mesh mesh_of(const DeviceTube& tube, int sides) {
  if (tube.inner_radius_mm == 0) {
    VesselBranch line;
    line.points = tube.points;
    return tube_mesh(VesselTree({line}, "device"), sides);
  }
  std::vector<glm::dvec3> nodes_mm;
  for (const VesselPoint& point : tube.points) nodes_mm.push_back(point.position_mm);
  return band_mesh(curve_through(nodes_mm), tube.points[0].radius_mm, tube.inner_radius_mm);
}

}  // namespace

const DeviceMaterial& material_of(DeviceMatter matter) {
  static const std::array<DeviceMaterial, kDeviceMatters> materials = all_materials();
  return materials[static_cast<std::size_t>(matter)];
}

Surface device_surface(const DeviceTube& tube) {
  if (tube.points.empty()) return {};
  const DeviceMaterial& material = material_of(tube.matter);
  return {.mesh = mesh_of(tube, material.tube_sides),
          .mu_per_mm = material.mu_per_mm,
          .colour = material.colour,
          .mu_weights = {},
          .tube_sides = material.tube_sides};
}

std::vector<Surface> device_surfaces(const std::vector<DeviceTube>& tubes) {
  std::vector<Surface> surfaces;
  for (const DeviceTube& tube : tubes) surfaces.push_back(device_surface(tube));
  return surfaces;
}

}  // namespace xraycast
