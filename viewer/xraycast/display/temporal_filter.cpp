#include "xraycast/display/temporal_filter.hpp"

#include "xraycast/display/display_loops.hpp"

#include <algorithm>
#include <functional>
#include <utility>

namespace xraycast {
namespace {

// Chosen by eye: units' settings are not published.
constexpr float kNewFrameWeight = 0.4f;  // where nothing moves: a quarter of the noise's variance stays
// In how many times what noise makes nearby something begins to move, and has moved.
constexpr float kStill = 1.4f, kMoved = 2.0f;

/// A picture with kLineReach pixels more on all sides.
PictureSize padded(const PictureSize& size) {
  return {size.width + 2 * kLineReach, size.height + 2 * kLineReach};
}

/// The place of row j in it.
std::size_t padded_row(const PictureSize& size, int j) {
  return padded(size).row(j + kLineReach) + kLineReach;
}

}  // namespace

TemporalFilter::TemporalFilter(const PictureSize& size)
    : size_(size),
      ramps_(size, PictureSize::kBand),
      average_(size.pixels()),
      difference_(padded(size).pixels()),
      summed_(padded(size).pixels()),
      lines_(size.pixels()),
      usual_(ramps_.cells()) {}

void TemporalFilter::add(const PixelPlane& frame) {
  if (std::exchange(is_first_, false)) {
    average_ = frame;
    return;
  }
  subtract(frame);
  find_lines();
  for_bands(size_, [&](int first, int end) {
    thread_local PixelPlane usual;
    usual.resize(static_cast<std::size_t>(size_.width));
    for (int j = first; j < end; ++j) {
      ramps_.row(usual_.data(), 1, j, usual.data());
      recursive_row(frame.data() + size_.row(j), lines_.data() + size_.row(j), usual.data(),
                    {kNewFrameWeight, kStill, kMoved}, size_.width, average_.data() + size_.row(j));
    }
  });
}

void TemporalFilter::subtract(const PixelPlane& frame) {
  for_bands(size_, [&](int first, int end) {
    for (int j = first; j < end; ++j)
      std::transform(frame.begin() + static_cast<std::ptrdiff_t>(size_.row(j)),
                     frame.begin() + static_cast<std::ptrdiff_t>(size_.row(j + 1)),
                     average_.begin() + static_cast<std::ptrdiff_t>(size_.row(j)),
                     difference_.begin() + static_cast<std::ptrdiff_t>(padded_row(size_, j)), std::minus<>());
  });
  for_bands(size_, [&](int first, int end) {
    const auto row_at = [&](int j) { return difference_.data() + padded_row(size_, j) - 1; };
    for (int j = first; j < end; ++j)
      summed_row(row_at(j - 1), row_at(j), row_at(j + 1), size_.width, summed_.data() + padded_row(size_, j));
  });
}

void TemporalFilter::find_lines() {
  const int side = ramps_.cell();
  for_bands(size_, [&](int first, int end) {
    float* const usual = usual_.data() + static_cast<std::ptrdiff_t>(first / side) * ramps_.columns();
    std::fill_n(usual, ramps_.columns(), 0.0f);
    for (int j = first; j < end; ++j) {
      float* const lines = lines_.data() + size_.row(j);
      strongest_lines_row(summed_.data() + padded_row(size_, j), padded(size_).width, size_.width, lines);
      for (int column = 0; column < ramps_.columns(); ++column) {
        float sum = 0;
        for (int i = column * side; i < std::min((column + 1) * side, size_.width); ++i) sum += lines[i];
        usual[column] += sum;
      }
    }
    for (int column = 0; column < ramps_.columns(); ++column)
      usual[column] /= static_cast<float>((end - first) * std::min(side, size_.width - column * side));
  });
}

}  // namespace xraycast
