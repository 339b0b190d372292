#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <cstdint>

namespace xraycast {

/// How many pairs of a surface's triangles cross each other. Those with a corner in common do not count, nor
/// those that lie in one plane.
std::int64_t crossing_triangles(const Mesh& mesh);

}  // namespace xraycast
