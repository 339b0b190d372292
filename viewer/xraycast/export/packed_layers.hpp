#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/key_maps.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// The optical depths of a map's layers, ready to be deflated: differences from what their neighbours
/// predict, by the median edge detector of JPEG-LS (ISO/IEC 14495-1).
struct PackedLayers {
  /// Of each layer H x W bytes; as 16-bit floats all low bytes of a layer, then all high ones, of differences
  /// with their sign in the lowest bit.
  std::string bytes;
  std::vector<LayerByteRange> byte_ranges;  ///< of each layer, where values are bytes
};

/// `precision` is byte or float16, the map one with optical depths.
PackedLayers pack_layers(const BodyMap& map, MapPrecision precision);

/// The key maps of a body that moves, ready to be deflated.
struct PackedKeys {
  PackedLayers first;         ///< key 0, as a map that stands still
  std::string others;         ///< own rows, K x count x W of each: differences from those of the key before
  std::vector<KeyRows> rows;  ///< of all keys; they begin at multiples of four, and end so or at the last row
};

/// Of a map with optical depths. The key before differs in one mode, by one phase: the last mode that is not
/// at its first phase.
PackedKeys pack_keys(const KeyMaps& maps, const MapGeometry& geometry);

}  // namespace xraycast
