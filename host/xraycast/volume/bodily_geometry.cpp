#include "xraycast/volume/bodily_geometry.hpp"

#include "xraycast/base/error.hpp"

#include <cmath>

namespace xraycast {

void require_bodily(const VolumeGeometry& grid, const std::string& name) {
  constexpr double kLeast_mm = 0.001, kMost_mm = 100, kMostExtent_mm = 10'000, kMostPlace_mm = 100'000;
  const glm::dvec3 &voxel_mm = grid.spacing_mm, &origin_mm = grid.origin_mm;
  const glm::dvec3 extent_mm = voxel_mm * glm::dvec3(grid.size);
  for (int axis = 0; axis < 3; ++axis) {
    if (voxel_mm[axis] < kLeast_mm || voxel_mm[axis] > kMost_mm)
      throw InputError("{}: voxel spacing {:g} x {:g} x {:g} mm must be {:g} to {:g} mm; check its unit",
                       name, voxel_mm.x, voxel_mm.y, voxel_mm.z, kLeast_mm, kMost_mm);
    if (extent_mm[axis] > kMostExtent_mm)
      throw InputError("{}: its extent of {:g} x {:g} x {:g} mm must be below {:g} m; check its unit", name,
                       extent_mm.x, extent_mm.y, extent_mm.z, kMostExtent_mm / 1000);
    if (std::abs(origin_mm[axis]) > kMostPlace_mm)
      throw InputError("{}: the origin ({:g}, {:g}, {:g}) mm must be within {:g} m of 0; check its unit",
                       name, origin_mm.x, origin_mm.y, origin_mm.z, kMostPlace_mm / 1000);
  }
}

}  // namespace xraycast
