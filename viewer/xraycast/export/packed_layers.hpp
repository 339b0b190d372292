#pragma once

#include "xraycast/casting/body_map.hpp"

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

}  // namespace xraycast
