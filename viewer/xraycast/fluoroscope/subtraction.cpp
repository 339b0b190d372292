#include "xraycast/fluoroscope/subtraction.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/display/display_loops.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

/// Weights of four neighbours, for a place between the middle two: Keys, IEEE Trans Acoust 29:1153, 1981.
std::array<float, 4> cubic_weights(double t) {
  const double t2 = t * t, t3 = t2 * t;
  return {static_cast<float>(0.5 * (-t + 2 * t2 - t3)), static_cast<float>(0.5 * (2 - 5 * t2 + 3 * t3)),
          static_cast<float>(0.5 * (t + 4 * t2 - 3 * t3)), static_cast<float>(0.5 * (t3 - t2))};
}

/// A shift of a line of pixels: where the first of four neighbours is, and their weights.
struct LineShift {
  int first;
  std::array<float, 4> weights;
  explicit LineShift(double pixels)
      : first(static_cast<int>(std::floor(-pixels)) - 1),
        weights(cubic_weights(-pixels - std::floor(-pixels))) {}
};

/// Calls work(first, end) for runs of pixels, on all cores.
template <typename Work>
void for_runs(std::size_t count, const Work& work) {
  constexpr std::size_t kRun = 1 << 15;
  parallel_for(static_cast<std::int64_t>((count + kRun - 1) / kRun), [&](std::int64_t run) {
    const std::size_t first = static_cast<std::size_t>(run) * kRun;
    work(first, std::min(first + kRun, count));
  });
}

}  // namespace

Subtraction::Subtraction(int width, int height) : width_(width), height_(height) {}

void Subtraction::add_to_mask(std::span<const float> frame, const std::string& name) {
  if (frame.size() != static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_))
    throw InputError("{}: has {} pixels, and the frames {} x {}; take a mask of the same geometry", name,
                     frame.size(), width_, height_);
  ++mask_frames_;
  mask_.resize(frame.size());
  const float share = 1.0f / static_cast<float>(mask_frames_);
  for (std::size_t i = 0; i < frame.size(); ++i) mask_[i] += share * (frame[i] - mask_[i]);
  is_moved_ = false;
}

void Subtraction::set_mask(std::span<const float> frame) {
  mask_frames_ = 0;
  add_to_mask(frame);
}

void Subtraction::shift_mask(PixelShift shift) {
  // Beyond the picture nothing of the mask would be left.
  const double x = static_cast<double>(width_), y = static_cast<double>(height_);
  shift = {std::clamp(shift.right, -x, x), std::clamp(shift.down, -y, y)};
  if (shift == shift_) return;
  shift_ = shift;
  is_moved_ = false;
}

/// First along the rows, then along the columns.
void Subtraction::move_mask() {
  is_moved_ = true;
  moved_ = mask_;
  if (shift_ == PixelShift{}) return;
  const LineShift right(shift_.right), down(shift_.down);
  const auto width = static_cast<std::size_t>(width_);
  std::vector<float> rows(mask_.size());
  parallel_for(height_, [&](std::int64_t y) {
    const float* from = &mask_[static_cast<std::size_t>(y) * width];
    float* to = &rows[static_cast<std::size_t>(y) * width];
    for (int x = 0; x < width_; ++x)
      for (int i = 0; i < 4; ++i)
        to[x] +=
            right.weights[static_cast<std::size_t>(i)] * from[std::clamp(x + right.first + i, 0, width_ - 1)];
  });
  parallel_for(height_, [&](std::int64_t y) {
    float* to = &moved_[static_cast<std::size_t>(y) * width];
    std::fill_n(to, width, 0.0f);
    for (int i = 0; i < 4; ++i) {
      const int row = std::clamp(static_cast<int>(y) + down.first + i, 0, height_ - 1);
      const float* from = &rows[static_cast<std::size_t>(row) * width];
      const float weight = down.weights[static_cast<std::size_t>(i)];
      for (std::size_t x = 0; x < width; ++x) to[x] += weight * from[x];
    }
  });
}

void Subtraction::subtract(std::span<const float> frame, std::span<float> difference) {
  if (mask_frames_ == 0) {
    std::fill(difference.begin(), difference.end(), 0.0f);
    return;
  }
  if (!is_moved_) move_mask();
  for_runs(frame.size(), [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) difference[i] = frame[i] - moved_[i];
  });
}

void MaximumOpacification::add(std::span<const float> difference) {
  if (largest_.size() != difference.size()) return largest_.assign(difference.begin(), difference.end());
  for_runs(largest_.size(), [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) largest_[i] = std::max(largest_[i], difference[i]);
  });
}

std::vector<std::uint8_t> subtraction_greys(std::span<const float> difference,
                                            const SubtractionWindow& window) {
  constexpr float kWhite = 255, kHalf = 0.5f;  // for rounding
  const float background = kWhite * static_cast<float>(window.background);
  const float slope = background / static_cast<float>(window.black);
  std::vector<std::uint8_t> greys(difference.size());
  for_runs(difference.size(), [&](std::size_t first, std::size_t end) {
    windowed_row(&difference[first], -slope, background + kHalf, static_cast<int>(end - first),
                 &greys[first]);
  });
  return greys;
}

std::vector<std::uint8_t> subtraction_picture(std::span<const float> difference,
                                              const SubtractionWindow& window) {
  return rgb_of(subtraction_greys(difference, window));
}

SubtractionWindow automatic_subtraction_window(std::span<const float> difference) {
  constexpr float kLeast = 0.01f;  // a picture without contrast agent is not stretched to its noise
  SubtractionWindow window;
  window.black = kLeast;
  if (difference.empty()) return window;
  std::vector<float> sorted(difference.begin(), difference.end());
  const auto at = sorted.end() - 1 - std::ssize(sorted) / 1000;
  std::nth_element(sorted.begin(), at, sorted.end());
  window.black = std::max(kLeast, *at);
  return window;
}

}  // namespace xraycast
