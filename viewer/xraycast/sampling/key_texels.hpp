#pragma once

#include "xraycast/casting/key_maps.hpp"
#include "xraycast/sampling/map_texels.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace xraycast {

/// A channel of the key maps of a moving body as the shaders read it (see MapTexels), in bytes with one range
/// for each drawn layer, from which the texels of any instant are blended.
class KeyTexels {
 public:
  /// As make_texels takes them; `geometry` is that of the map as it is drawn (drawn_geometry).
  KeyTexels(const KeyMaps& maps, std::size_t channel, const MapGeometry& geometry,
            const SampleOptions& options, std::span<const float> layer_weights);

  const std::vector<LayerByteRange>& byte_ranges() const { return byte_ranges_; }
  std::size_t size_B() const;

  /// The texels at an instant, one phase a mode, layout.values() of them; they are written and never read.
  /// Shares are rounded to 1/256.
  void blend(const KeyMaps& maps, std::span<const double> phases, std::span<std::byte> texels) const;

 private:
  /// A key map's own rows: layers x columns x rows, the rows of a column contiguous.
  struct Key {
    KeyRows rows;
    std::vector<std::byte> bytes;
  };

  MapTexels layout_;
  int height_;
  std::vector<LayerByteRange> byte_ranges_;
  std::vector<Key> keys_;
};

}  // namespace xraycast
