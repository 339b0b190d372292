#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <string>

namespace xraycast {

/// A mesh, ready to be deflated, with normals outwards (see PackedNumbers).
struct PackedMesh {
  static constexpr double kUnit_mm =
      1.0 / 128;  ///< of the coordinates: 1 % of the radius of the thinnest vessels

  /// All x, then all y, then all z, in units, as differences from the point before; where the points are
  /// rings of a tube, from that and the change between the points of the ring before.
  std::string points;
  /// The corners, as differences from those of the triangle before.
  std::string triangles;
  int ring = 0;  ///< points of a ring; 0: none
};

PackedMesh pack_mesh(const Mesh& mesh);

}  // namespace xraycast
