#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/sampling/column_samples.hpp"

#include <span>

namespace xraycast {

/// How a map's values lie as the shaders read them: one run of rows, padded to a multiple of four, for each
/// texel column; layers x (width + 1) x rows, the last column of a layer repeating its first, so that two
/// neighbours are always beside each other.
struct MapTexels {
  int layers = 0;
  int columns = 0;  ///< of a layer
  int quads = 0;    ///< of four rows

  int layer_stride() const { return columns * quads; }  ///< in quads
  std::size_t values() const { return std::size_t{4} * layers * layer_stride(); }
};

/// Of a map that is drawn in these shells (see drawn_shells).
MapTexels texels_of(const MapGeometry& drawn);

/// Prepares one channel of a map (K x H x W, as in BodyMap): what the compositing sums up, the optical depth
/// of a wall or mu in the middles of the drawn shells (see drawn_shells, RadialProfile), each layer times its
/// strength. Rectangle maps are taken as they are. `strengths` is empty, for 1 everywhere, or has one a
/// layer. `texels` holds as many values as texels_of says; they are written and never read.
void make_texels(const MapGeometry& geometry, std::span<const float> values, const SampleOptions& options,
                 std::span<const float> strengths, std::span<float> texels);

}  // namespace xraycast
