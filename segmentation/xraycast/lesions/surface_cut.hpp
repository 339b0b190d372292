#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <cstdint>
#include <functional>
#include <vector>

namespace xraycast {

/// A length or a signed measure at points of a surface.
using PointMeasure = std::function<double(const glm::dvec3& point_mm)>;

/// The surface with edges halved until none is longer than `edge_mm` at its ends and its middle. It keeps its
/// shape, its closedness and its other triangles.
Mesh with_shorter_edges(const Mesh& mesh, const PointMeasure& edge_mm);

/// A part of a surface, and the loops along which it was cut: points in order, with the part on their left.
struct CutSurface {
  Mesh part;
  std::vector<std::vector<std::uint32_t>> loops;
  bool is_clean = true;  ///< whether each point of a cut has one neighbour on either side
};

/// The part where `measure` is above zero, cut where it is zero. The measure is continuous.
CutSurface part_above_zero(const Mesh& mesh, const PointMeasure& measure);

/// Closes a loop by rings of points: `rings[j](i)` would be clumsy, so `point(i, j)` is the place of the
/// loop's point i on ring j, from 1 to `rings` - 1, and `middle` the point where all meet.
void close_loop(Mesh& mesh, const std::vector<std::uint32_t>& loop, int rings, const glm::dvec3& middle_mm,
                const std::function<glm::dvec3(std::size_t i, int ring)>& point_mm);

/// The surface without points that no triangle has.
Mesh without_loose_points(const Mesh& mesh);

/// How many pieces of a surface do not hang together.
std::size_t piece_count(const Mesh& mesh);

}  // namespace xraycast
