#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace xraycast {

/// How the values of a body map are stored, in its file and in its texture.
enum class MapPrecision {
  float32,  ///< 32-bit floats
  float16,  ///< 16-bit floats: 11 binary digits of every value
  byte,     ///< 8 bits, between the least and the largest value of each layer
};

/// As users write them: float, half and byte.
std::string to_string(MapPrecision precision);

/// Throws InputError, naming the valid ones, for another name.
MapPrecision parse_map_precision(const std::string& name);

/// The values that the bytes 0 to 255 of a layer stand for: offset + scale * byte.
struct ByteRange {
  float offset = 0, scale = 0;

  std::uint8_t byte_of(float value) const;
  float value_of(float byte) const { return offset + scale * byte; }
  bool operator==(const ByteRange&) const = default;
};

/// From the least to the largest of values, which are finite.
ByteRange byte_range_of(std::span<const float> values);

}  // namespace xraycast
