#include "xraycast/casting/map_precision.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

std::string to_string(MapPrecision precision) {
  switch (precision) {
    case MapPrecision::float32:
      return "float";
    case MapPrecision::float16:
      return "half";
    case MapPrecision::byte:
      return "byte";
  }
  return {};
}

MapPrecision parse_map_precision(const std::string& name) {
  for (const auto precision : {MapPrecision::float32, MapPrecision::float16, MapPrecision::byte})
    if (name == to_string(precision)) return precision;
  throw InputError("unknown precision '{}'; choose float, half or byte", excerpt(name));
}

std::uint8_t LayerByteRange::byte_of(float value) const {
  if (!(scale > 0)) return 0;
  return static_cast<std::uint8_t>(std::lround(std::clamp((value - offset) / scale, 0.0f, 255.0f)));
}

LayerByteRange byte_range_of(std::span<const float> values) {
  if (values.empty()) return {};
  const auto [least, largest] = std::ranges::minmax(values);
  return {least, (largest - least) / 255};
}

}  // namespace xraycast
