#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/projection/projector.hpp"

#include <optional>
#include <vector>

namespace xraycast {

/// The part of each of a view's rays (row by row) that lies in the volume of a map: the cylinder of its
/// radius from the first row's upper edge to the last one's lower edge, or the sphere; nothing where a ray
/// misses it. An outline is ignored: a DRR along these integrates the same matter as a map of circles.
/// Throws InputError for a curved axis, whose volume is not a cylinder.
std::vector<std::optional<RaySegment>> rays_within(const View& view, const MapGeometry& geometry);

/// A part of the ray of a pixel, which is counted row by row.
struct PixelSegment {
  std::size_t pixel;
  RaySegment segment;
};

/// What of these rays lies in the map's shells: the same under circles; under an outline a ray may enter and
/// leave it more than once. Pixel by pixel, in order along the ray. Throws as rays_within.
std::vector<PixelSegment> segments_within(const View& view, const MapGeometry& geometry);

}  // namespace xraycast
