#include "xraycast/display/dynamic_range.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/display/display_loops.hpp"

#include <array>
#include <cmath>

namespace xraycast {
namespace {

constexpr double kMostCell_mm = 5, kRadius_mm = 10;

/// The largest even power of two up to a band's rows whose cells are small enough.
int cell_for(double pixel_mm) {
  int cell = PictureSize::kBand;
  while (cell > 2 && cell * pixel_mm > kMostCell_mm) cell /= 2;
  return cell;
}

/// Sums over boxes of cells; beyond the plane, cells are as at its edge.
class BoxSums {
 public:
  BoxSums(const PixelPlane& plane, int columns, int rows, int pad)
      : pad_(pad), stride_(columns + 2 * pad + 1) {
    sums_.assign(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(rows + 2 * pad + 1), 0);
    for (int y = 0; y < rows + 2 * pad; ++y) {
      const float* const row =
          plane.data() + static_cast<std::ptrdiff_t>(std::clamp(y - pad, 0, rows - 1)) * columns;
      double sum = 0;
      for (int x = 0; x < columns + 2 * pad; ++x) {
        sum += row[std::clamp(x - pad, 0, columns - 1)];
        sums_[at(x + 1, y + 1)] = sums_[at(x + 1, y)] + sum;
      }
    }
  }

  /// Over columns x - left to x + right and rows y - up to y + down, none of them beyond the pad.
  double mean(int x, int y, int left, int right, int up, int down) const {
    const int x0 = x + pad_ - left, x1 = x + pad_ + right + 1, y0 = y + pad_ - up, y1 = y + pad_ + down + 1;
    const double sum = sums_[at(x1, y1)] - sums_[at(x0, y1)] - sums_[at(x1, y0)] + sums_[at(x0, y0)];
    return sum / ((left + right + 1) * (up + down + 1));
  }

 private:
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(stride_) + static_cast<std::size_t>(x);
  }
  int pad_, stride_;
  std::vector<double> sums_;
};

/// Calls work(x, y, index) for every cell.
template <typename Work>
void for_cells(const CellRamps& grid, const Work& work) {
  parallel_for(grid.rows(), [&](std::int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < grid.columns(); ++x)
      work(x, y,
           static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.columns()) +
               static_cast<std::size_t>(x));
  });
}

/// Of the eight windows that have a cell on a side or in a corner, the mean that is most like it.
double side_mean(const BoxSums& sums, int x, int y, int r, double value) {
  constexpr std::array<std::array<int, 4>, 8> kWindows{{{1, 1, 1, 0},
                                                        {1, 1, 0, 1},
                                                        {1, 0, 1, 1},
                                                        {0, 1, 1, 1},
                                                        {1, 0, 1, 0},
                                                        {0, 1, 1, 0},
                                                        {1, 0, 0, 1},
                                                        {0, 1, 0, 1}}};
  double best = 0, least = HUGE_VAL;
  for (const auto& [left, right, up, down] : kWindows) {
    const double mean = sums.mean(x, y, left * r, right * r, up * r, down * r);
    if (std::abs(mean - value) >= least) continue;
    least = std::abs(mean - value);
    best = mean;
  }
  return best;
}

}  // namespace

DynamicRange::DynamicRange(const PictureSize& size, double pixel_mm)
    : size_(size),
      ramps_(size, cell_for(pixel_mm)),
      radius_(std::clamp(static_cast<int>(std::lround(kRadius_mm / (ramps_.cell() * pixel_mm))), 1, 16)) {
  for (PixelPlane* plane : {&means_, &base_, &slope_, &start_}) plane->resize(ramps_.cells());
}

void DynamicRange::measure(const PixelPlane& logarithm) {
  average(logarithm);
  base_ = means_;
  constexpr int kPasses = 2;
  for (int pass = 0; pass < kPasses; ++pass) {
    const BoxSums sums(base_, ramps_.columns(), ramps_.rows(), radius_);
    for_cells(ramps_, [&](int x, int y, std::size_t cell) {
      base_[cell] = static_cast<float>(side_mean(sums, x, y, radius_, base_[cell]));
    });
  }
  fit_lines();
  // A cell that a sharp edge parts is a mixture, whose window lies on one side. On the lines it is a mixture
  // again.
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t cell = 0; cell < base_.size(); ++cell)
      base_[cell] = slope_[cell] * means_[cell] + start_[cell];
    fit_lines();
  }
}

void DynamicRange::average(const PixelPlane& logarithm) {
  const int side = ramps_.cell();
  parallel_for(ramps_.rows(), [&](std::int64_t cells) {
    float* const row = means_.data() + cells * ramps_.columns();
    const int first = static_cast<int>(cells) * side, end = std::min(first + side, size_.height);
    std::fill_n(row, ramps_.columns(), 0.0f);
    for (int j = first; j < end; ++j) {
      const float* const pixels = logarithm.data() + size_.row(j);
      for (int column = 0; column < ramps_.columns(); ++column) {
        const int last = std::min((column + 1) * side, size_.width);
        float sum = 0;
        for (int i = column * side; i < last; ++i) sum += pixels[i];
        row[column] += sum;
      }
    }
    for (int column = 0; column < ramps_.columns(); ++column)
      row[column] /= static_cast<float>((end - first) * std::min(side, size_.width - column * side));
  });
}

/// By least squares over 3 x 3 cells; then the mean of the lines of 3 x 3 cells.
void DynamicRange::fit_lines() {
  constexpr double kFlat = 0.02 * 0.02;  // variance below which the base is taken for a constant
  const int columns = ramps_.columns(), rows = ramps_.rows();
  PixelPlane squares(means_.size()), products(means_.size());
  for (std::size_t i = 0; i < means_.size(); ++i) {
    squares[i] = means_[i] * means_[i];
    products[i] = means_[i] * base_[i];
  }
  const BoxSums mean(means_, columns, rows, 1), base(base_, columns, rows, 1),
      square(squares, columns, rows, 1), product(products, columns, rows, 1);
  for_cells(ramps_, [&](int x, int y, std::size_t cell) {
    const double m = mean.mean(x, y, 1, 1, 1, 1), b = base.mean(x, y, 1, 1, 1, 1),
                 variance = std::max(0.0, square.mean(x, y, 1, 1, 1, 1) - m * m),
                 slope = (product.mean(x, y, 1, 1, 1, 1) - m * b) / (variance + kFlat);
    slope_[cell] = static_cast<float>(slope);
    start_[cell] = static_cast<float>(b - slope * m);
  });
  const BoxSums slopes(slope_, columns, rows, 1), starts(start_, columns, rows, 1);
  for_cells(ramps_, [&](int x, int y, std::size_t cell) {
    slope_[cell] = static_cast<float>(slopes.mean(x, y, 1, 1, 1, 1));
    start_[cell] = static_cast<float>(starts.mean(x, y, 1, 1, 1, 1));
  });
}

void DynamicRange::compress_row(int j, const float* logarithm, float strength, float middle,
                                float* out) const {
  thread_local PixelPlane slope, start;
  slope.resize(static_cast<std::size_t>(size_.width));
  start.resize(static_cast<std::size_t>(size_.width));
  ramps_.row(slope_.data(), strength, j, slope.data());
  ramps_.row(start_.data(), strength, j, start.data());
  compressed_row(logarithm, slope.data(), start.data(), strength * middle, size_.width, out);
}

}  // namespace xraycast
