#pragma once

#include "xraycast/mechanics/lanes.hpp"

#include <array>
#include <cstddef>

namespace xraycast {

// Matrices of four rows and four columns, by columns.

using LaneColumns = std::array<Lanes, kLanes>;

[[gnu::always_inline]] inline LaneColumns load_columns(const double* from) {
  return {load(from), load(from + kLanes), load(from + 2 * kLanes), load(from + 3 * kLanes)};
}
[[gnu::always_inline]] inline void store_columns(double* to, const LaneColumns& columns) {
  for (std::size_t c = 0; c < kLanes; ++c) store(to + kLanes * c, columns[c]);
}
[[gnu::always_inline]] inline void add_to_columns(double* to, const LaneColumns& columns) {
  for (std::size_t c = 0; c < kLanes; ++c) add_to(to + kLanes * c, columns[c]);
}
[[gnu::always_inline]] inline LaneColumns transposed(const LaneColumns& columns) {
  return transposed(columns[0], columns[1], columns[2], columns[3]);
}
[[gnu::always_inline]] inline LaneColumns sum(const LaneColumns& a, const LaneColumns& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]};
}
/// a b^T.
[[gnu::always_inline]] inline LaneColumns outer_product(const Lanes& a, const Lanes& b) {
  return {a * b[0], a * b[1], a * b[2], a * b[3]};
}
/// Each column times its own factor.
[[gnu::always_inline]] inline LaneColumns columns_scaled(const LaneColumns& columns, const Lanes& factors) {
  return {columns[0] * factors[0], columns[1] * factors[1], columns[2] * factors[2], columns[3] * factors[3]};
}
/// Each row times its own factor, or all times the same.
template <typename Factors>
[[gnu::always_inline]] inline LaneColumns rows_scaled(const LaneColumns& columns, const Factors& factors) {
  return {columns[0] * factors, columns[1] * factors, columns[2] * factors, columns[3] * factors};
}

}  // namespace xraycast
