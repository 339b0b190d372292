#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace xraycast {

/// A symmetric positive definite matrix whose entries lie within kBand of its diagonal, and the solution of
/// its linear system by LDL^T (Golub and Van Loan, Matrix Computations, 4th ed., 2013, section 4.3), in time
/// linear in its size.
class BandMatrix {
 public:
  /// Of a rod: the strain of a node couples the positions of three nodes and the angles of two edges.
  static constexpr std::size_t kBand = 10;
  /// From one column's diagonal to the next one's in memory: padded to whole vectors of four.
  static constexpr std::size_t kStride = 12;

  /// Sets the size and all entries to zero. Allocates only when it grows beyond its largest size.
  void reset(std::size_t size);

  /// Allocates for `size` rows.
  void reserve(std::size_t size) { columns_.reserve(size + kBand); }

  std::size_t size() const { return size_; }

  /// The entry (column + below, column) of the lower half; `below` is at most kBand.
  double& at(std::size_t column, std::size_t below) { return columns_[column][below]; }

  /// A column's lower half: its diagonal and kBand entries below it.
  double* column(std::size_t index) { return columns_[index].data(); }
  const double* column(std::size_t index) const { return columns_[index].data(); }

  /// Eliminates the first unknowns: their solution is their right-hand side, and they are decoupled from the
  /// others.
  void fix_first(std::size_t count);

  /// Replaces the matrix by its factors. Returns false, and leaves it unusable, unless it is positive
  /// definite.
  bool factorise();

  /// Replaces a right-hand side of size() numbers, and kBand zeros after them, by the solution; after
  /// factorise().
  void solve(double* x) const;

 private:
  using Column = std::array<double, kStride>;
  std::vector<Column> columns_;  ///< kBand more than the size, so that no loop needs a bound check
  std::size_t size_ = 0;
};

}  // namespace xraycast
