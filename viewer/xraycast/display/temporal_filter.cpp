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
constexpr float kSurelyMoved = 3;  // no noise is as strong

/// A line reaches so many pixels to both sides of its middle: four steps.
constexpr int kLineReach = 8;

/// How many pixels beside a line its side reaches: half of the width of instruments.
constexpr int kBeside = 3;

/// A picture with kLineReach pixels more on all sides.
PictureSize padded(const PictureSize& size) {
  return {size.width + 2 * kLineReach, size.height + 2 * kLineReach};
}

/// The place of row j in it.
std::size_t padded_row(const PictureSize& size, int j) {
  return padded(size).row(j + kLineReach) + kLineReach;
}

/// The strongest of the lines through each of a row's pixels, every second pixel of each, in eight
/// directions. `stride`: pixels of a row.
void strongest_lines_row(const std::int16_t* pixels, std::ptrdiff_t stride, int count, std::int16_t* lines) {
  constexpr int kRun = 512;  // whose lines' pixels stay in the first-level cache from direction to direction
  std::fill_n(lines, count, std::int16_t{0});
  for (int from = 0; from < count; from += kRun)
    for (const std::ptrdiff_t step : {std::ptrdiff_t{2}, 2 * stride, 2 * stride + 2, 2 * stride - 2,
                                      stride + 2, stride - 2, 2 * stride + 1, 2 * stride - 1})
      stronger_line_row(pixels + from, step, std::min(kRun, count - from), lines + from);
}

}  // namespace

TemporalFilter::TemporalFilter(const PictureSize& size)
    : size_(size),
      ramps_(size, PictureSize::kBand),
      average_(size.pixels()),
      difference_(padded(size).pixels()),
      summed_(padded(size).pixels()),
      lines_(size.pixels()),
      means_(ramps_.cells()),
      usual_(ramps_.cells()),
      moved_(padded(size).pixels()),
      beside_(padded(size).pixels()) {}

void TemporalFilter::add(const PixelPlane& frame) {
  if (std::exchange(is_first_, false)) {
    average_ = frame;
    is_noise_new_ = true;
    return;
  }
  subtract(frame);
  find_lines();
  follow_noise();
  find_moved();
  for_bands(size_, [&](int first, int end) {
    thread_local PixelPlane usual;
    thread_local std::vector<std::uint8_t> moved;
    usual.resize(static_cast<std::size_t>(size_.width));
    moved.resize(usual.size());
    for (int j = first; j < end; ++j) {
      ramps_.row(usual_.data(), 1, j, usual.data());
      std::fill(moved.begin(), moved.end(), std::uint8_t{0});
      for (int by = -kBeside; by <= kBeside; ++by)
        united_row(beside_.data() + padded_row(size_, j + by), size_.width, moved.data());
      recursive_row(frame.data() + size_.row(j), lines_.data() + size_.row(j), usual.data(), moved.data(),
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

/// Noise stays, and what moves passes: falls are followed at once, rises slowly.
void TemporalFilter::follow_noise() {
  constexpr float kFall = 0.5f, kRise = 0.05f;
  if (std::exchange(is_noise_new_, false)) {
    usual_ = means_;
    return;
  }
  for (std::size_t cell = 0; cell < usual_.size(); ++cell) {
    const float change = means_[cell] - usual_[cell];
    usual_[cell] += change < 0 ? kFall * change : std::min(change, kRise * usual_[cell]);
  }
}

void TemporalFilter::find_moved() {
  for_bands(size_, [&](int first, int end) {
    thread_local PixelPlane usual;
    usual.resize(static_cast<std::size_t>(size_.width));
    for (int j = first; j < end; ++j) {
      ramps_.row(usual_.data(), 1, j, usual.data());
      const std::size_t at = padded_row(size_, j);
      above_row(lines_.data() + size_.row(j), usual.data(), kSurelyMoved, size_.width, moved_.data() + at);
      std::fill_n(beside_.data() + at, size_.width, std::uint8_t{0});
      for (int by = -kBeside; by <= kBeside; ++by)
        united_row(moved_.data() + static_cast<std::ptrdiff_t>(at) + by, size_.width, beside_.data() + at);
    }
  });
}

void TemporalFilter::find_lines() {
  const int side = ramps_.cell();
  for_bands(size_, [&](int first, int end) {
    float* const means = means_.data() + static_cast<std::ptrdiff_t>(first / side) * ramps_.columns();
    std::fill_n(means, ramps_.columns(), 0.0f);
    thread_local PixelPlane counts;
    counts.assign(static_cast<std::size_t>(ramps_.columns()), 0.0f);
    for (int j = first; j < end; ++j) {
      std::int16_t* const lines = lines_.data() + size_.row(j);
      strongest_lines_row(summed_.data() + padded_row(size_, j), padded(size_).width, size_.width, lines);
      for (int column = 0; column < ramps_.columns(); ++column) {
        int sum = 0, count = 0;
        for (int i = column * side; i < std::min((column + 1) * side, size_.width); ++i) {
          sum += lines[i];
          count += lines[i] > 0 ? 1 : 0;  // behind blades there is nothing
        }
        means[column] += static_cast<float>(sum);
        counts[static_cast<std::size_t>(column)] += static_cast<float>(count);
      }
    }
    for (int column = 0; column < ramps_.columns(); ++column)
      means[column] /= std::max(counts[static_cast<std::size_t>(column)], 1.0f);
  });
}

}  // namespace xraycast
