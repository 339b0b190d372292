#pragma once

#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// The watertight isosurface of a mask: a level set, smoothed by half a voxel, at the level that encloses the
/// mask's volume; then decimated to about `triangles`. Vessels that leave the grid are closed there.
/// OpenVDB's volume mesher and meshoptimizer's simplifier (Garland and Heckbert, Surface simplification using
/// quadric error metrics, 1997); where decimation would open the surface it is left finer. Throws Error when
/// the mask is empty.
Mesh surface_of(const Mask& mask, std::size_t triangles);

/// The same for segmented vessels: where their mask holds all voxels that lumen touches, at the level that
/// encloses the lumen's volume.
Mesh surface_of(const Mask& mask, const LumenFill& fill, std::size_t triangles);

/// A closed surface decimated to about that many triangles by meshoptimizer, less where that would open it or
/// change its volume by more than a hundredth.
Mesh with_fewer_triangles(Mesh closed, std::size_t triangles);

}  // namespace xraycast
