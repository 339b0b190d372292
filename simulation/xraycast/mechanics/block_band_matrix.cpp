#include "xraycast/mechanics/block_band_matrix.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lanes.hpp"

#include <algorithm>

namespace xraycast {
namespace {

constexpr std::size_t kBlockSize = BlockBandMatrix::kBlock;
using MatrixBlock = BlockBandMatrix::Block;

/// A column of a block, as one vector of the processor.
using BlockColumn __attribute__((vector_size(kBlockSize * sizeof(double)), aligned(sizeof(double)))) = double;

inline BlockColumn& column_of(MatrixBlock& block, std::size_t c) {
  return *reinterpret_cast<BlockColumn*>(&block[kBlockSize * c]);
}
inline const BlockColumn& column_of(const MatrixBlock& block, std::size_t c) {
  return *reinterpret_cast<const BlockColumn*>(&block[kBlockSize * c]);
}

/// Replaces a symmetric block, of which the lower half counts, L D L^T, by the inverse of L (whose diagonal
/// is one) below the diagonal and the inverse of D on it.
[[gnu::always_inline]] inline bool factorise_block(MatrixBlock& a) {
  const auto at = [&a](std::size_t r, std::size_t c) -> double& { return a[kBlockSize * c + r]; };
  const double d0 = at(0, 0), by0 = 1 / d0;
  const double l10 = at(1, 0) * by0, l20 = at(2, 0) * by0, l30 = at(3, 0) * by0;
  const double d1 = at(1, 1) - l10 * at(1, 0), by1 = 1 / d1;
  const double a21 = at(2, 1) - l20 * at(1, 0), a31 = at(3, 1) - l30 * at(1, 0);
  const double l21 = a21 * by1, l31 = a31 * by1;
  const double d2 = (at(2, 2) - l20 * at(2, 0)) - l21 * a21, by2 = 1 / d2;
  const double a32 = (at(3, 2) - l30 * at(2, 0)) - l31 * a21, l32 = a32 * by2;
  const double d3 = ((at(3, 3) - l30 * at(3, 0)) - l31 * a31) - l32 * a32, by3 = 1 / d3;
  const double m20 = l21 * l10 - l20, m31 = l32 * l21 - l31;
  at(0, 0) = by0, at(1, 1) = by1, at(2, 2) = by2, at(3, 3) = by3;
  at(1, 0) = -l10, at(2, 1) = -l21, at(3, 2) = -l32;
  at(2, 0) = m20, at(3, 1) = m31;
  at(3, 0) = (l31 * l10 - l30) - l32 * m20;
  return d0 > 0 && d1 > 0 && d2 > 0 && d3 > 0;
}

/// Of a block below the diagonal: x L^-T and, in its place, x L^-T D^-1.
[[gnu::always_inline]] inline void divide_from_right(const MatrixBlock& factor, MatrixBlock& x,
                                                     MatrixBlock& undivided) {
  const auto inverse = [&factor](std::size_t r, std::size_t c) { return factor[kBlockSize * c + r]; };
  const BlockColumn x0 = column_of(x, 0), x1 = column_of(x, 1), x2 = column_of(x, 2), x3 = column_of(x, 3);
  const BlockColumn y1 = x1 + x0 * inverse(1, 0), y2 = x2 + x0 * inverse(2, 0) + x1 * inverse(2, 1),
                    y3 = (x3 + x0 * inverse(3, 0)) + (x1 * inverse(3, 1) + x2 * inverse(3, 2));
  column_of(undivided, 0) = x0, column_of(undivided, 1) = y1;
  column_of(undivided, 2) = y2, column_of(undivided, 3) = y3;
  column_of(x, 0) = x0 * inverse(0, 0), column_of(x, 1) = y1 * inverse(1, 1);
  column_of(x, 2) = y2 * inverse(2, 2), column_of(x, 3) = y3 * inverse(3, 3);
}

/// Subtracts x y^T from blocks that follow each other in a column, of as many x: they share what is read of
/// y.
template <std::size_t kCount>
[[gnu::always_inline]] inline void subtract_products(const MatrixBlock* x, const MatrixBlock& y,
                                                     MatrixBlock* from) {
  BlockColumn sums[kCount][kBlockSize];
#pragma GCC unroll 2
  for (std::size_t k = 0; k < kCount; ++k)
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kBlockSize; ++c) sums[k][c] = column_of(from[k], c);
      // Unrolled, this would need more registers than there are.
#pragma GCC unroll 1
  for (std::size_t n = 0; n < kBlockSize; ++n)
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kBlockSize; ++c)
#pragma GCC unroll 2
      for (std::size_t k = 0; k < kCount; ++k) sums[k][c] -= column_of(x[k], n) * y[kBlockSize * n + c];
#pragma GCC unroll 2
  for (std::size_t k = 0; k < kCount; ++k)
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kBlockSize; ++c) column_of(from[k], c) = sums[k][c];
}

/// Divides the blocks below a column's diagonal and subtracts their products from the columns
/// after it, which start at `starts`.
template <std::size_t kBelow>
[[gnu::always_inline]] inline void eliminate(MatrixBlock* column, const std::size_t* starts,
                                             MatrixBlock* blocks) {
  std::array<MatrixBlock, kBelow + 1> undivided;
#pragma GCC unroll 6
  for (std::size_t k = 1; k <= kBelow; ++k) divide_from_right(column[0], column[k], undivided[k]);
#pragma GCC unroll 6
  for (std::size_t m = 1; m <= kBelow; ++m) {
    MatrixBlock* other = blocks + starts[m];
    const std::size_t last = kBelow - m;
#pragma GCC unroll 3
    for (std::size_t k = 0; k < last; k += 2) subtract_products<2>(&undivided[m + k], column[m], other + k);
    if (last % 2 == 0) subtract_products<1>(&undivided[kBelow], column[m], other + last);
  }
}
/// The same for any number of blocks.
[[gnu::always_inline]] inline void eliminate(std::size_t below, MatrixBlock* column,
                                             const std::size_t* starts, MatrixBlock* blocks) {
  for (std::size_t k = 1; k <= below; ++k) {
    MatrixBlock undivided;
    divide_from_right(column[0], column[k], undivided);
    // Those above it in the column are divided already.
    for (std::size_t m = 1; m <= k; ++m)
      subtract_products<1>(&undivided, column[m], &blocks[starts[m] + k - m]);
  }
}

/// A diagonal block's L^-1 x.
[[gnu::always_inline]] inline BlockColumn solved_lower(const MatrixBlock& factor, BlockColumn x) {
  const BlockColumn by0 = column_of(factor, 0), by1 = column_of(factor, 1);
  return (x + BlockColumn{0, by0[1], by0[2], by0[3]} * x[0]) +
         (BlockColumn{0, 0, by1[2], by1[3]} * x[1] + BlockColumn{0, 0, 0, factor[2 * kBlockSize + 3]} * x[2]);
}
/// L^-T x.
[[gnu::always_inline]] inline BlockColumn solved_upper(const MatrixBlock& factor, BlockColumn x) {
  const auto inverse = [&factor](std::size_t r, std::size_t c) { return factor[kBlockSize * c + r]; };
  return (x + BlockColumn{inverse(1, 0), 0, 0, 0} * x[1]) +
         (BlockColumn{inverse(2, 0), inverse(2, 1), 0, 0} * x[2] +
          BlockColumn{inverse(3, 0), inverse(3, 1), inverse(3, 2), 0} * x[3]);
}
[[gnu::always_inline]] inline BlockColumn inverse_pivots(const MatrixBlock& factor) {
  return BlockColumn{factor[0], factor[kBlockSize + 1], factor[2 * kBlockSize + 2],
                     factor[3 * kBlockSize + 3]};
}

}  // namespace

void BlockBandMatrix::reserve(std::size_t columns, std::size_t blocks) {
  reaches_.reserve(columns);
  starts_.reserve(columns);
  blocks_.reserve(blocks);
}

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
    const std::size_t* starts = &starts_[j];
    // A rod alone has two blocks below the diagonal, a pair some five; their loops are unrolled.
    switch (const std::size_t below = reaches_[j] - j) {
      case 2:
        eliminate<2>(column, starts, blocks_.data());
        break;
      case 4:
        eliminate<4>(column, starts, blocks_.data());
        break;
      case 5:
        eliminate<5>(column, starts, blocks_.data());
        break;
      case 6:
        eliminate<6>(column, starts, blocks_.data());
        break;
      default:
        eliminate(below, column, starts, blocks_.data());
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
    const BlockColumn solved = solved_lower(column[0], part(j));
    for (std::size_t k = 1; k <= reaches_[j] - j; ++k)
      part(j + k) -= (column_of(column[k], 0) * solved[0] + column_of(column[k], 1) * solved[1]) +
                     (column_of(column[k], 2) * solved[2] + column_of(column[k], 3) * solved[3]);
    part(j) = solved * inverse_pivots(column[0]);
  }
  for (std::size_t j = reaches_.size(); j-- > 0;) {
    const Block* column = &blocks_[starts_[j]];
    // What was solved last comes last, so that the rest need not wait for it.
    BlockColumn sums[kBlockSize] = {};
    for (std::size_t k = reaches_[j] - j; k >= 1; --k)
      for (std::size_t c = 0; c < kBlockSize; ++c) sums[c] += column_of(column[k], c) * part(j + k);
    const auto [row0, row1, row2, row3] = transposed(sums[0], sums[1], sums[2], sums[3]);
    part(j) = solved_upper(column[0], part(j) - ((row0 + row1) + (row2 + row3)));
  }
}

}  // namespace xraycast
