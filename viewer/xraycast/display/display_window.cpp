#include "xraycast/display/display_window.hpp"

#include <cmath>

namespace xraycast {
namespace {

constexpr int kBins = 1024, kCountedEvery = 4;                 // rows
constexpr float kLowest = -8, kHighest = 24;                   // of the logarithms that are told apart
constexpr float kBody = 0.35f;                                 // of optical depth, some 2 cm of water
constexpr double kEnds = 0.003;                                // of the pixels, on either side
constexpr float kMargin = 0.06f;                               // of the width, for noise and sharpened edges
constexpr float kLeastWidth = 1.6f, kFollowingWeight = 0.15f;  // chosen by eye

float logarithm_of(int bin) {
  return kLowest + (kHighest - kLowest) * (static_cast<float>(bin) + 0.5f) / kBins;
}

}  // namespace

DisplayWindow::DisplayWindow(const PictureSize& size)
    : size_(size), width_(kLeastWidth), counts_(static_cast<std::size_t>(size.bands() * kBins)) {}

void DisplayWindow::begin(double open_logarithm) {
  body_below_ = static_cast<float>(open_logarithm) - kBody;
  std::fill(counts_.begin(), counts_.end(), 0);
}

void DisplayWindow::count_row(int j, const float* logarithm, const float* shown, const float* field) {
  if (j % kCountedEvery != 0) return;
  constexpr float kOpen = 0.5f, kPerLogarithm = kBins / (kHighest - kLowest);
  std::uint32_t* const counts = counts_.data() + static_cast<std::ptrdiff_t>(j / PictureSize::kBand) * kBins;
  for (int i = 0; i < size_.width; ++i)
    if (logarithm[i] < body_below_ && field[i] > kOpen)
      ++counts[std::clamp(static_cast<int>((shown[i] - kLowest) * kPerLogarithm), 0, kBins - 1)];
}

void DisplayWindow::follow() {
  std::vector<std::uint64_t> counts(kBins);
  std::uint64_t all = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    counts[i % kBins] += counts_[i];
    all += counts_[i];
  }
  if (all == 0) return;
  const auto ends = static_cast<std::uint64_t>(kEnds * static_cast<double>(all));
  int low = 0, high = kBins - 1;
  for (std::uint64_t below = counts[0]; below <= ends;) below += counts[static_cast<std::size_t>(++low)];
  for (std::uint64_t above = counts[kBins - 1]; above <= ends;)
    above += counts[static_cast<std::size_t>(--high)];
  const float width = std::max(kLeastWidth, (1 + 2 * kMargin) * (logarithm_of(high) - logarithm_of(low))),
              middle = 0.5f * (logarithm_of(low) + logarithm_of(high)),
              weight = is_first_ ? 1 : kFollowingWeight;
  width_ = std::lerp(width_, width, weight);
  middle_ = std::lerp(middle_, middle, weight);
  is_first_ = false;
}

}  // namespace xraycast
