#include "xraycast/coaxial/block_band_matrix.hpp"

#include "xraycast/base/wide_vectors.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr std::size_t kBlockSize = BlockBandMatrix::kBlock;
using MatrixBlock = BlockBandMatrix::Block;

/// Replaces the lower half by its Cholesky factor, with the inverse of each pivot on the diagonal.
inline bool factorise_block(MatrixBlock& a) {
  for (std::size_t c = 0; c < kBlockSize; ++c) {
    double* column = &a[kBlockSize * c];
    if (!(column[c] > 0)) return false;
    const double inverse = 1 / std::sqrt(column[c]);
    column[c] = inverse;
    for (std::size_t r = c + 1; r < kBlockSize; ++r) column[r] *= inverse;
    for (std::size_t m = c + 1; m < kBlockSize; ++m)
      for (std::size_t r = m; r < kBlockSize; ++r) a[kBlockSize * m + r] -= column[r] * column[m];
  }
  return true;
}

/// A column of a block, as one vector of the processor.
using BlockColumn __attribute__((vector_size(kBlockSize * sizeof(double)), aligned(sizeof(double)))) = double;

inline BlockColumn& column_of(MatrixBlock& block, std::size_t c) {
  return *reinterpret_cast<BlockColumn*>(&block[kBlockSize * c]);
}
inline const BlockColumn& column_of(const MatrixBlock& block, std::size_t c) {
  return *reinterpret_cast<const BlockColumn*>(&block[kBlockSize * c]);
}

/// Replaces x by x factor^-T.
inline void divide_from_right(const MatrixBlock& factor, MatrixBlock& x) {
  for (std::size_t c = 0; c < kBlockSize; ++c) {
    column_of(x, c) *= factor[kBlockSize * c + c];
    for (std::size_t m = c + 1; m < kBlockSize; ++m)
      column_of(x, m) -= column_of(x, c) * factor[kBlockSize * c + m];
  }
}

/// Subtracts x y^T.
inline void subtract_product(const MatrixBlock& x, const MatrixBlock& y, MatrixBlock& from) {
  const BlockColumn x0 = column_of(x, 0), x1 = column_of(x, 1), x2 = column_of(x, 2), x3 = column_of(x, 3);
  for (std::size_t c = 0; c < kBlockSize; ++c)
    column_of(from, c) -=
        (x0 * y[c] + x1 * y[kBlockSize + c]) + (x2 * y[2 * kBlockSize + c] + x3 * y[3 * kBlockSize + c]);
}

/// Of a diagonal block, which has the inverse of each pivot.
inline void solve_lower(const MatrixBlock& factor, double* x) {
  for (std::size_t c = 0; c < kBlockSize; ++c) {
    x[c] *= factor[kBlockSize * c + c];
    for (std::size_t r = c + 1; r < kBlockSize; ++r) x[r] -= factor[kBlockSize * c + r] * x[c];
  }
}
inline void solve_upper(const MatrixBlock& factor, double* x) {
  for (std::size_t c = kBlockSize; c-- > 0;) {
    for (std::size_t r = c + 1; r < kBlockSize; ++r) x[c] -= factor[kBlockSize * c + r] * x[r];
    x[c] *= factor[kBlockSize * c + c];
  }
}

}  // namespace

void BlockBandMatrix::reset(const std::vector<std::size_t>& reaches) {
  reaches_.assign(reaches.begin(), reaches.end());
  starts_.resize(reaches_.size());
  std::size_t count = 0, reach = 0;
  for (std::size_t j = 0; j < reaches_.size(); ++j) {
    // What a column's elimination fills in lies within the reach of the columns after it.
    reach = std::max({reach, reaches_[j], j});
    reaches_[j] = reach;
    starts_[j] = count;
    count += reach - j + 1;
  }
  blocks_.assign(count, Block{});
}

XRAYCAST_WIDE_VECTORS
bool BlockBandMatrix::factorise() {
  for (std::size_t j = 0; j < reaches_.size(); ++j) {
    Block* column = &blocks_[starts_[j]];
    if (!factorise_block(column[0])) return false;
    const std::size_t below = reaches_[j] - j;
    for (std::size_t k = 1; k <= below; ++k) divide_from_right(column[0], column[k]);
    for (std::size_t k = 1; k <= below; ++k) {
      Block* other = &blocks_[starts_[j + k]];
      for (std::size_t m = k; m <= below; ++m) subtract_product(column[m], column[k], other[m - k]);
    }
  }
  return true;
}

XRAYCAST_WIDE_VECTORS
void BlockBandMatrix::solve(double* x) const {
  const auto part = [x](std::size_t block) -> BlockColumn& {
    return *reinterpret_cast<BlockColumn*>(x + kBlockSize * block);
  };
  for (std::size_t j = 0; j < reaches_.size(); ++j) {
    const Block* column = &blocks_[starts_[j]];
    solve_lower(column[0], x + kBlockSize * j);
    const BlockColumn solved = part(j);
    for (std::size_t k = 1; k <= reaches_[j] - j; ++k) {
      BlockColumn& other = part(j + k);
      other -= (column_of(column[k], 0) * solved[0] + column_of(column[k], 1) * solved[1]) +
               (column_of(column[k], 2) * solved[2] + column_of(column[k], 3) * solved[3]);
    }
  }
  for (std::size_t j = reaches_.size(); j-- > 0;) {
    const Block* column = &blocks_[starts_[j]];
    BlockColumn sums[kBlockSize] = {};
    for (std::size_t k = 1; k <= reaches_[j] - j; ++k)
      for (std::size_t c = 0; c < kBlockSize; ++c) sums[c] += column_of(column[k], c) * part(j + k);
    for (std::size_t c = 0; c < kBlockSize; ++c)
      part(j)[c] -= (sums[c][0] + sums[c][1]) + (sums[c][2] + sums[c][3]);
    solve_upper(column[0], x + kBlockSize * j);
  }
}

}  // namespace xraycast
