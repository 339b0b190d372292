#pragma once

#include "xraycast/volume/slice_source.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

namespace xraycast {

/// The empty range: including another one gives that one.
inline constexpr SliceSource::HuRange kNoHu{std::numeric_limits<double>::infinity(),
                                            -std::numeric_limits<double>::infinity()};

inline void include(SliceSource::HuRange& range, const SliceSource::HuRange& other) {
  range.lowest = std::min(range.lowest, other.lowest);
  range.highest = std::max(range.highest, other.highest);
  range.not_numbers += other.not_numbers;
  range.clamped += other.clamped;
}

/// HU as they are stored: rounded, and clamped to [-1024, 32767]. NaN becomes air.
inline std::int16_t to_hu(double value) {
  return value > kPaddingHu ? static_cast<std::int16_t>(std::lrint(std::min<double>(value, kMaxHu)))
                            : kPaddingHu;
}

/// Writes stored values as HU = value * slope + intercept, and returns their range before clamping. Above
/// 32767 HU they are clamped, and NaN and minus infinity become air; the range counts both. `stored`
/// may be the memory of `hu` itself.
template <typename T>
SliceSource::HuRange rescale(std::span<const T> stored, double slope, double intercept,
                             std::span<std::int16_t> hu) {
  // Nearly every scanner writes 16-bit integers with slope 1: clamped before the addition they stay within 16
  // bits, which any processor's vector unit handles eight at a time.
  if constexpr (std::is_integral_v<T> && sizeof(T) == 2) {
    using Limits = std::numeric_limits<T>;
    const double lower = std::max<double>(kPaddingHu - intercept, Limits::min());
    const double upper = std::min<double>(kMaxHu - intercept, Limits::max());
    if (slope == 1 && intercept == std::trunc(intercept) && lower <= upper) {
      const T lowest_kept = static_cast<T>(lower), highest_kept = static_cast<T>(upper);
      const auto offset = static_cast<int>(intercept);
      T lowest = Limits::max(), highest = Limits::min();
      for (std::size_t i = 0; i < stored.size(); ++i) {
        const T value = stored[i];
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
        hu[i] = static_cast<std::int16_t>(std::min(std::max(value, lowest_kept), highest_kept) + offset);
      }
      const std::int64_t clamped =
          highest > highest_kept ? std::ranges::count(hu.first(stored.size()), kMaxHu) : 0;
      return {.lowest = lowest + intercept, .highest = highest + intercept, .clamped = clamped};
    }
  }
  SliceSource::HuRange range = kNoHu;
  for (std::size_t i = 0; i < stored.size(); ++i) {
    const double value = static_cast<double>(stored[i]) * slope + intercept;
    // Written so that a value that is not a number leaves the range alone.
    const bool is_number = value > -std::numeric_limits<double>::infinity();
    range.lowest = std::min(range.lowest, is_number ? value : range.lowest);
    range.highest = std::max(range.highest, value);
    range.not_numbers += is_number ? 0 : 1;
    range.clamped += value >= kMaxHu ? 1 : 0;
    hu[i] = to_hu(value);
  }
  if (range.highest <= kMaxHu) range.clamped = 0;
  return range;
}

}  // namespace xraycast
