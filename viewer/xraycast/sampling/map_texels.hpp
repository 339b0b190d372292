#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/sampling/column_samples.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace xraycast {

/// The geometry of a map's rays as they are drawn. Where air absorbs, rays met more of it beyond the scan,
/// whose bounds then do not end them.
MapGeometry drawn_geometry(const BodyMap& map);

/// The layout of a map's values as the shaders read them: layers x (width + 1) x rows, the rows of a texel
/// column contiguous and padded to a multiple of four with the last row, so that byte ranges stay. The
/// last column of a layer repeats its first, so that every column has a neighbour behind it.
struct MapTexels {
  int layers = 0;
  int columns = 0;  ///< of a layer
  int quads = 0;    ///< of four rows

  int layer_stride() const { return columns * quads; }  ///< in quads
  std::size_t values() const { return std::size_t{4} * layers * layer_stride(); }
};

/// Of a map that is drawn in these shells (see drawn_shells).
MapTexels texels_of(const MapGeometry& drawn);

/// Converts one channel of a map (K x H x W, as in BodyMap) to the values that compositing sums: the optical
/// depth of a wall, or mu in the middles of the drawn shells (see drawn_shells, RadialProfile), each layer
/// times its weight. Rectangle maps are copied. `layer_weights` is empty, for 1 everywhere, or has one weight
/// per layer. `texels` holds as many values as given by texels_of; they are written and never read.
void make_texels(const MapGeometry& geometry, std::span<const float> values, const SampleOptions& options,
                 std::span<const float> layer_weights, std::span<float> texels);

/// Texels as a texture of less precision stores them.
struct PackedTexels {
  std::vector<std::byte> values;
  std::vector<LayerByteRange> byte_ranges;  ///< of each layer, where bytes are stored
};

/// `precision` is not that of 32-bit floats; the largest 16-bit float stands for values beyond it.
PackedTexels pack_texels(const MapTexels& layout, std::span<const float> texels, MapPrecision precision);

}  // namespace xraycast
