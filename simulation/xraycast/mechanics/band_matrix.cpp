#include "xraycast/mechanics/band_matrix.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lanes.hpp"

namespace xraycast {

void BandMatrix::reset(std::size_t size) {
  size_ = size;
  columns_.assign(size + kBand, Column{});
}

void BandMatrix::fix_first(std::size_t count) {
  for (std::size_t j = 0; j < count; ++j) columns_[j] = Column{1};
}

namespace {

/// A column's entries in vectors of four.
struct ColumnLanes {
  Lanes low, middle, high;
};

/// Four entries from number kShift of the first four on.
template <int kShift>
[[gnu::always_inline]] inline Lanes shifted(const Lanes& first, const Lanes& second) {
  return __builtin_shufflevector(first, second, kShift, kShift + 1, kShift + 2, kShift + 3);
}

/// Subtracts `factor` times a column's entries from number kFrom on.
template <int kFrom>
[[gnu::always_inline]] inline void subtract_from(double* column, double factor, const ColumnLanes& pivot) {
  constexpr int kShift = kFrom % 4;
  const Lanes from_low = shifted<kShift>(pivot.low, pivot.middle),
              from_middle = shifted<kShift>(pivot.middle, pivot.high),
              from_high = shifted<kShift>(pivot.high, Lanes{});
  if constexpr (kFrom < 4) {
    add_to(column, -factor * from_low);
    add_to(column + 4, -factor * from_middle);
    if constexpr (kFrom < 3) add_to(column + 8, -factor * from_high);  // the last entry of all is padding
  } else if constexpr (kFrom < 8) {
    add_to(column, -factor * from_middle);
    if constexpr (kFrom < 7) add_to(column + 4, -factor * from_high);
  } else {
    add_to(column, -factor * from_high);
  }
}

}  // namespace

XRAYCAST_WIDE_VECTORS
bool BandMatrix::factorise() {
  static_assert(kBand == 10 && kStride == 12);
  for (std::size_t j = 0; j < size_; ++j) {
    double* column = columns_[j].data();
    const ColumnLanes pivot{load(column), load(column + 4), load(column + 8)};
    if (!(pivot.low[0] > 0)) return false;
    const double inverse = 1 / pivot.low[0];
    const ColumnLanes scaled{inverse * pivot.low, inverse * pivot.middle, inverse * pivot.high};
    subtract_from<1>(column + kStride, scaled.low[1], pivot);
    subtract_from<2>(column + 2 * kStride, scaled.low[2], pivot);
    subtract_from<3>(column + 3 * kStride, scaled.low[3], pivot);
    subtract_from<4>(column + 4 * kStride, scaled.middle[0], pivot);
    subtract_from<5>(column + 5 * kStride, scaled.middle[1], pivot);
    subtract_from<6>(column + 6 * kStride, scaled.middle[2], pivot);
    subtract_from<7>(column + 7 * kStride, scaled.middle[3], pivot);
    subtract_from<8>(column + 8 * kStride, scaled.high[0], pivot);
    subtract_from<9>(column + 9 * kStride, scaled.high[1], pivot);
    subtract_from<10>(column + 10 * kStride, scaled.high[2], pivot);
    store(column, scaled.low);
    store(column + 4, scaled.middle);
    store(column + 8, scaled.high);
    column[0] = pivot.low[0];
  }
  return true;
}

XRAYCAST_WIDE_VECTORS
void BandMatrix::solve(double* x) const {
  for (std::size_t j = 0; j < size_; ++j)
    for (std::size_t k = 1; k <= kBand; ++k) x[j + k] -= columns_[j][k] * x[j];
  for (std::size_t k = 0; k < kBand; ++k) x[size_ + k] = 0;
  for (std::size_t j = size_; j-- > 0;) {
    // What was solved last comes last, so that the rest need not wait for it; in two sums, so that additions
    // wait less for each other.
    double even = x[j] / columns_[j][0], odd = 0;
    for (std::size_t k = kBand; k > 2; k -= 2) {
      even -= columns_[j][k] * x[j + k];
      odd -= columns_[j][k - 1] * x[j + k - 1];
    }
    const double rest = (even + odd) - columns_[j][2] * x[j + 2];
    x[j] = rest - columns_[j][1] * x[j + 1];
  }
}

}  // namespace xraycast
