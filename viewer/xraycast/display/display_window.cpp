#include "xraycast/display/display_window.hpp"

#include "xraycast/base/metal_depth.hpp"

#include <cmath>
#include <numeric>
#include <optional>

namespace xraycast {
namespace {

constexpr int kBins = 1024, kCountedEvery = 4;                 // rows
constexpr float kLowest = -8, kHighest = 24;                   // of the logarithms that are told apart
constexpr float kBody = 0.35f;                                 // of optical depth, some 2 cm of water
constexpr double kEnds = 0.003;                                // of the pixels, on either side
constexpr float kMargin = 0.06f;                               // of the width, for noise and sharpened edges
constexpr float kLeastWidth = 1.6f, kFollowingWeight = 0.15f;  // chosen by eye
constexpr float kMetalGreys = 0.08f;                           // of the greys, chosen by eye
constexpr float kOpen = 0.5f, kLeastLeft = 1e-20f, kWhite = 255;

float logarithm_of(int bin) {
  return kLowest + (kHighest - kLowest) * (static_cast<float>(bin) + 0.5f) / kBins;
}

using Counts = std::vector<std::uint32_t>;

/// Those of all bands.
std::vector<std::uint64_t> summed(const Counts& of_bands) {
  std::vector<std::uint64_t> counts(kBins);
  for (std::size_t i = 0; i < of_bands.size(); ++i) counts[i % kBins] += of_bands[i];
  return counts;
}

std::uint64_t total(const std::vector<std::uint64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

/// That so many pixels lie at or below.
int low_end(const std::vector<std::uint64_t>& counts, std::uint64_t ends) {
  int low = 0;
  for (std::uint64_t below = counts[0]; below <= ends && low + 1 < kBins;)
    below += counts[static_cast<std::size_t>(++low)];
  return low;
}

int high_end(const std::vector<std::uint64_t>& counts, std::uint64_t ends) {
  int high = kBins - 1;
  for (std::uint64_t above = counts[kBins - 1]; above <= ends && high > 0;)
    above += counts[static_cast<std::size_t>(--high)];
  return high;
}

}  // namespace

DisplayWindow::DisplayWindow(const PictureSize& size)
    : size_(size),
      width_(kLeastWidth),
      counts_(static_cast<std::size_t>(size.bands() * kBins)),
      metal_counts_(counts_.size()) {}

void DisplayWindow::begin(double open_logarithm, const PixelPlane& left, const PixelPlane& field) {
  body_below_ = static_cast<float>(open_logarithm) - kBody;
  counts_.assign(counts_.size(), 0);
  metal_counts_.assign(metal_counts_.size(), 0);
  std::vector<DepthCounts> depths(static_cast<std::size_t>(size_.bands()));
  for_bands(size_, [&](int first, int end) {
    DepthCounts& counts = depths[static_cast<std::size_t>(first / PictureSize::kBand)];
    for (int j = first; j < end; ++j) {
      if (j % kCountedEvery != 0) continue;
      const std::size_t at = size_.row(j);
      for (std::size_t i = at; i < at + static_cast<std::size_t>(size_.width); i += kCountedEvery)
        if (const float depth = -std::log(std::max(left[i], kLeastLeft)); depth > kBody && field[i] > kOpen)
          counts.add(depth);
    }
  });
  for (std::size_t band = 1; band < depths.size(); ++band) depths[0].add(depths[band]);
  const std::optional<float> metal = depths[0].metal_from();
  metal_below_ = metal ? std::exp(-*metal) : 0;
}

void DisplayWindow::count_row(int j, const float* logarithm, const float* shown, const float* left,
                              const float* field) {
  if (j % kCountedEvery != 0) return;
  constexpr float kPerLogarithm = kBins / (kHighest - kLowest);
  const std::ptrdiff_t band = static_cast<std::ptrdiff_t>(j / PictureSize::kBand) * kBins;
  for (int i = 0; i < size_.width; ++i)
    if (logarithm[i] < body_below_ && field[i] > kOpen)
      ++((left[i] < metal_below_ ? metal_counts_ : counts_).data() +
         band)[std::clamp(static_cast<int>((shown[i] - kLowest) * kPerLogarithm), 0, kBins - 1)];
}

void DisplayWindow::follow() {
  const std::vector<std::uint64_t> counts = summed(counts_), metal = summed(metal_counts_);
  const std::uint64_t all = total(counts), all_metal = total(metal);
  if (all == 0) return;
  const auto ends = static_cast<std::uint64_t>(kEnds * static_cast<double>(all));
  const float low = logarithm_of(low_end(counts, ends)), high = logarithm_of(high_end(counts, ends));
  const float width = std::max(kLeastWidth, (1 + 2 * kMargin) * (high - low)), middle = 0.5f * (low + high),
              weight = is_first_ ? 1 : kFollowingWeight;
  const bool has_metal = all_metal > ends;
  const float darkest = has_metal ? logarithm_of(low_end(metal, ends)) : low;
  // What the body's window shows already, as metal behind which scatter prevails, needs no greys of its own.
  const float deeper = middle - 0.5f * width - darkest, depth = deeper > 0 ? deeper + kMargin * width : 0;
  width_ = std::lerp(width_, width, weight);
  middle_ = std::lerp(middle_, middle, weight);
  greys_ = std::lerp(greys_, std::min(kMetalGreys, depth / width), weight);
  depth_ = std::lerp(depth_, depth, weight);
  is_first_ = false;
}

GreyLine DisplayWindow::body() const {
  const float per_log = (1 - greys_) * kWhite / width_;
  return {per_log, 0.5f * kWhite * (1 + greys_) - per_log * middle_};
}

GreyLine DisplayWindow::metal() const {
  const GreyLine of_body = body();
  const float per_log = greys_ * kWhite / std::max(depth_, 1e-6f);
  if (per_log >= of_body.per_log || greys_ == 0) return of_body;
  return {per_log, greys_ * kWhite - per_log * (middle_ - 0.5f * width_)};
}

}  // namespace xraycast
