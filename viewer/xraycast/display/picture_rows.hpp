#pragma once

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace xraycast {

/// One value for each pixel of a picture, row 0 on top.
using PixelPlane = std::vector<float>;

/// Of a picture that is worked on by bands of rows, on all cores.
struct PictureSize {
  static constexpr int kBand = 16;  ///< rows of a band, and pixels of a side of scatter's cells
  int width = 0, height = 0;

  std::size_t pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  /// The number of a row's first pixel.
  std::size_t row(int j) const { return static_cast<std::size_t>(j) * static_cast<std::size_t>(width); }
  int bands() const { return (height + kBand - 1) / kBand; }
};

/// Calls work(first, end) for the rows of each band, on all cores.
template <typename Work>
void for_bands(const PictureSize& size, const Work& work) {
  parallel_for(size.bands(), [&](std::int64_t band) {
    const int first = static_cast<int>(band) * PictureSize::kBand;
    work(first, std::min(first + PictureSize::kBand, size.height));
  });
}

}  // namespace xraycast
