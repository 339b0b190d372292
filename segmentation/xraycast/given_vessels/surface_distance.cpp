#include "xraycast/given_vessels/surface_distance.hpp"

#include "xraycast/base/loaded_module.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {

double surface_area_mm2(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const glm::dvec3 p = mesh.points_mm[a];
    sum +=
        0.5 * glm::length(glm::cross(glm::dvec3(mesh.points_mm[b]) - p, glm::dvec3(mesh.points_mm[c]) - p));
  }
  return sum;
}

double spacing_of_distances_mm(const Mesh& mesh, double least_radius_mm, double most_distances) {
  constexpr double kFineness = 16;
  const double area = surface_area_mm2(mesh), radius_mm = 2 * std::abs(volume_mm3(mesh)) / area;
  return std::max(std::sqrt(2 * SurfaceDistance::kBand * area / most_distances),
                  std::min(radius_mm / kFineness, 0.5 * least_radius_mm));
}

// Measured, with a third more.
constexpr MemoryNeed kOpenVdb{100 << 20, 30 << 20};

std::unique_ptr<SurfaceDistance> surface_distance(const Mesh& closed, double spacing_mm) {
  using Make = SurfaceDistance* (*)(const Mesh&, double);
  static const auto make = reinterpret_cast<Make>(
      module_function(XRAYCAST_SURFACE_DISTANCE_MODULE, "xraycast_surface_distance", kOpenVdb));
  return std::unique_ptr<SurfaceDistance>(make(closed, spacing_mm));
}

}  // namespace xraycast
