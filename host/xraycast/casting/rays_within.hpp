#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/casting/projector.hpp"

#include <optional>
#include <vector>

namespace xraycast {

/// The part of each of a view's rays (row by row) that lies in the volume of a map: the cylinder of its
/// radius from the first row's upper edge to the last one's lower edge, or the sphere; nothing where a ray
/// misses it. A DRR along these integrates the same matter as the map. Throws InputError for a curved axis,
/// whose volume is not a cylinder.
std::vector<std::optional<RaySegment>> rays_within(const View& view, const MapGeometry& geometry);

}  // namespace xraycast
