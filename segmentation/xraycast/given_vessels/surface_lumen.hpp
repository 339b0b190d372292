#pragma once

#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/given_vessels/surface_distance.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/skeleton/lumen.hpp"

namespace xraycast {

/// The space inside a surface, for centrelines whose skeleton was found in its mask on a coarser grid. Far
/// from the wall, inscribed spheres are those of the mask.
class SurfaceLumen : public Lumen {
 public:
  /// Both must outlive it.
  SurfaceLumen(const SurfaceDistance& wall, const Mask& mask);

  double voxel_mm() const override { return mask_.voxel_mm(); }
  double coarsest_mm() const override { return mask_.coarsest_mm(); }
  double least_radius_mm() const override { return 0.5 * wall_.spacing_mm(); }
  bool contains(const glm::dvec3& point_mm) const override { return mask_.contains(point_mm); }
  double inscribed_radius_mm(const glm::dvec3& point_mm) const override;
  double occupancy(const glm::dvec3& point_mm) const override;

 private:
  const SurfaceDistance& wall_;
  MaskLumen mask_;
};

/// How much of each voxel of a grid lies inside a surface, as if the wall through it were flat.
LumenFill fill_of(const SurfaceDistance& wall, const VolumeGeometry& grid);

/// The voxels that are half full or more.
Mask half_full(const LumenFill& fill);

/// A grid of cubic voxels around a surface, three voxels beyond it on all sides: as fine as a number of
/// voxels allows, but not finer than `least_mm`.
VolumeGeometry grid_around(const Mesh& surface, std::int64_t voxels, double least_mm);

}  // namespace xraycast
