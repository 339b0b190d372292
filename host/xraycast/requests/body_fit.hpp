#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/volume/body_outline.hpp"

#include <glm/vec3.hpp>

#include <span>

namespace xraycast {

/// Fits the shells of a cylinder or sphere map to the body: R, how far they reach, encloses the body's voxels
/// that `finder` has found, in all slices, and lies at least a millimetre outside of the skin, but never
/// beyond the map's circle. R is smooth: its detail is about five degrees. A cylinder has one R a direction,
/// for all rows; a sphere one for every direction in space. `further_skin_mm` are more places to enclose, as
/// where the skin of a body that moves is at other instants.
///
/// Throws InputError when nothing lies within the circle.
MapGeometry fit_to_body(const MapGeometry& circles, const OutlineFinder& finder,
                        std::span<const glm::dvec3> further_skin_mm = {});

}  // namespace xraycast
