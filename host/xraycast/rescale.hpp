#pragma once

#include "xraycast/slice_source.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

namespace xraycast {

/// A range that holds nothing yet: including another one gives that one.
inline constexpr SliceSource::HuRange kNoHu{std::numeric_limits<double>::infinity(),
                                            -std::numeric_limits<double>::infinity()};

inline void include(SliceSource::HuRange& range, const SliceSource::HuRange& other) {
  range = {std::min(range.lowest, other.lowest), std::max(range.highest, other.highest)};
}

/// HU as they are kept: rounded, and clamped to [-1024, 32767]. Not a number reads as air.
inline std::int16_t to_hu(double value) {
  constexpr double kHighest = std::numeric_limits<std::int16_t>::max();
  return value > kAirHu ? static_cast<std::int16_t>(std::lrint(std::min(value, kHighest))) : kAirHu;
}

/// Writes stored values as HU = value * slope + intercept, and returns their range before clamping. `stored`
/// may be the memory of `hu` itself.
template <typename T>
SliceSource::HuRange rescale(std::span<const T> stored, double slope, double intercept,
                             std::span<std::int16_t> hu) {
  // Nearly every scanner writes integers with slope 1, which the compiler then vectorises.
  if constexpr (sizeof(T) <= 2) {
    if (slope == 1 && std::abs(intercept) < 1e6 && intercept == std::trunc(intercept)) {
      const auto offset = static_cast<std::int32_t>(intercept);
      std::int32_t lowest = std::numeric_limits<std::int32_t>::max();
      std::int32_t highest = std::numeric_limits<std::int32_t>::min();
      for (std::size_t i = 0; i < stored.size(); ++i) {
        const std::int32_t value = stored[i] + offset;
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
        hu[i] = static_cast<std::int16_t>(std::clamp<std::int32_t>(value, kAirHu, 32767));
      }
      return {static_cast<double>(lowest), static_cast<double>(highest)};
    }
  }
  SliceSource::HuRange range = kNoHu;
  for (std::size_t i = 0; i < stored.size(); ++i) {
    const double value = static_cast<double>(stored[i]) * slope + intercept;
    // Written so that a value that is not a number leaves the range alone.
    range.lowest = std::min(range.lowest, value);
    range.highest = std::max(range.highest, value);
    hu[i] = to_hu(value);
  }
  return range;
}

}  // namespace xraycast
