#pragma once

#include "xraycast/body_map.hpp"
#include "xraycast/viewer/column_samples.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// A map's values as the shaders read them: one run of rows, padded to a multiple of four, for each texel
/// column; layers x (width + 1) x rows, the last column of a layer repeating its first, so that two
/// neighbours are always beside each other.
struct MapTexels {
  int layers = 0;
  int columns = 0;  ///< of a layer
  int quads = 0;    ///< of four rows
  std::vector<float> values;

  int layer_stride() const { return columns * quads; }  ///< in quads
};

/// Prepares one channel of a map (K x H x W, as in BodyMap): what the compositing sums up, the optical depth
/// of a wall or mu in the middles of the drawn shells (see drawn_shells, RadialProfile), each layer times its
/// strength. Rectangle maps are taken as they are. `strengths` is empty, for 1 everywhere, or has one a
/// layer. `texels` may hold another map, whose memory is used again: to touch new memory takes as long.
void make_texels(const MapGeometry& geometry, std::span<const float> values, const SampleOptions& options,
                 std::span<const float> strengths, MapTexels& texels);

}  // namespace xraycast
