#include "xraycast/given_vessels/surface_distance.hpp"

#include "xraycast/base/loaded_module.hpp"

namespace xraycast {

// Measured, with a third more.
constexpr MemoryNeed kOpenVdb{100 << 20, 30 << 20};

std::unique_ptr<SurfaceDistance> surface_distance(const Mesh& closed, double spacing_mm) {
  using Make = SurfaceDistance* (*)(const Mesh&, double);
  static const auto make = reinterpret_cast<Make>(
      module_function(XRAYCAST_SURFACE_DISTANCE_MODULE, "xraycast_surface_distance", kOpenVdb));
  return std::unique_ptr<SurfaceDistance>(make(closed, spacing_mm));
}

}  // namespace xraycast
