#include "xraycast/mechanics/band_matrix.hpp"

#include "xraycast/base/wide_vectors.hpp"

namespace xraycast {

void BandMatrix::reset(std::size_t size) {
  size_ = size;
  columns_.assign(size + kBand, Column{});
}

void BandMatrix::fix_first(std::size_t count) {
  for (std::size_t j = 0; j < count; ++j) columns_[j] = Column{1};
}

XRAYCAST_WIDE_VECTORS
bool BandMatrix::factorise() {
  for (std::size_t j = 0; j < size_; ++j) {
    Column& pivot = columns_[j];
    if (!(pivot[0] > 0)) return false;
    const double inverse = 1 / pivot[0];
    Column scaled;
    for (std::size_t k = 0; k < scaled.size(); ++k) scaled[k] = pivot[k] * inverse;
#pragma GCC unroll 10
    for (std::size_t k = 1; k <= kBand; ++k) {
      Column& other = columns_[j + k];
      const double factor = scaled[k];
      for (std::size_t m = 0; m <= kBand - k; ++m) other[m] -= factor * pivot[k + m];
    }
    for (std::size_t k = 1; k <= kBand; ++k) pivot[k] = scaled[k];
  }
  return true;
}

XRAYCAST_WIDE_VECTORS
void BandMatrix::solve(double* x) const {
  for (std::size_t j = 0; j < size_; ++j)
    for (std::size_t k = 1; k <= kBand; ++k) x[j + k] -= columns_[j][k] * x[j];
  for (std::size_t k = 0; k < kBand; ++k) x[size_ + k] = 0;
  for (std::size_t j = size_; j-- > 0;) {
    // Two accumulators, so that additions do not wait for each other.
    double even = x[j] / columns_[j][0], odd = 0;
    for (std::size_t k = 1; k <= kBand; k += 2) {
      even -= columns_[j][k] * x[j + k];
      odd -= columns_[j][k + 1] * x[j + k + 1];
    }
    x[j] = even + odd;
  }
}

}  // namespace xraycast
