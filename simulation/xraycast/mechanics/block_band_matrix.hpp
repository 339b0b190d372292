#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace xraycast {

/// A symmetric positive definite matrix of 4 x 4 blocks, each column of which reaches down as far as it
/// needs, and the solution of its linear system by LDL^T (Golub and Van Loan, Matrix
/// Computations, 4th ed., 2013, sections 4.2.9 and 4.3).
class BlockBandMatrix {
 public:
  static constexpr std::size_t kBlock = 4;
  using Block = std::array<double, kBlock * kBlock>;  ///< entry (r, c) at 4 c + r

  /// Allocates for so many columns and blocks on and below the diagonal.
  void reserve(std::size_t columns, std::size_t blocks);

  /// Sets all entries to zero. `reaches` has each column's lowest block that is not zero; a column reaches as
  /// far as those before it. Allocates only when it grows beyond its largest size.
  void reset(const std::vector<std::size_t>& reaches);

  std::size_t columns() const { return reaches_.size(); }

  /// A block of the lower half, at most as low as the column reaches. Of those on the diagonal only the lower
  /// half counts.
  Block& at(std::size_t row, std::size_t column) { return blocks_[starts_[column] + row - column]; }

  /// Replaces the matrix by its factor. Returns false, and leaves it unusable, unless it is positive
  /// definite.
  bool factorise();

  /// Replaces a right-hand side by the solution; after factorise().
  void solve(double* x) const;

 private:
  std::vector<std::size_t> reaches_, starts_;
  std::vector<Block> blocks_;
};

}  // namespace xraycast
