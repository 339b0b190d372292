#pragma once

#include "xraycast/display/picture_rows.hpp"

namespace xraycast {

/// Values at the middles of a picture's square cells, read along the rows of pixels between them.
class CellRamps {
 public:
  /// `cell`: pixels of a side, even.
  CellRamps(const PictureSize& size, int cell)
      : size_(size),
        cell_(cell),
        columns_((size.width + cell - 1) / cell),
        rows_((size.height + cell - 1) / cell) {}

  int cell() const { return cell_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  std::size_t cells() const { return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_); }

  /// Row j of the picture, `weight` times the values of `cells`, row by row. Beyond the outer middles as
  /// there.
  void row(const float* cells, float weight, int j, float* out) const;

 private:
  PictureSize size_;
  int cell_, columns_, rows_;
};

}  // namespace xraycast
