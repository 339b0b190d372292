#include "xraycast/display/edge_enhancement.hpp"

#include "xraycast/display/display_loops.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace xraycast {
namespace {

constexpr double kReach_mm = 1.5;
constexpr int kLeastReach = 2, kMostReach = 20;

/// The sums of columns with what the picture goes on with on both sides.
class PaddedSums {
 public:
  PaddedSums(int width, int reach) : width_(width), reach_(reach), all_(width + 2 * std::size_t(reach)) {}

  void begin() { std::fill(all_.begin(), all_.end(), 0.0f); }
  void add(const float* row) { added_row(row, width_, sums()); }
  void move(const float* entering, const float* leaving) { moved_row(entering, leaving, width_, sums()); }

  /// Of the picture's first column.
  const float* padded() {
    std::fill_n(all_.data(), reach_, sums()[0]);
    std::fill_n(sums() + width_, reach_, sums()[width_ - 1]);
    return sums();
  }

 private:
  float* sums() { return all_.data() + reach_; }

  int width_, reach_;
  std::vector<float> all_;
};

}  // namespace

EdgeEnhancement::EdgeEnhancement(const PictureSize& size, double pixel_mm)
    : size_(size),
      reach_(std::clamp(static_cast<int>(std::lround(kReach_mm / pixel_mm)), kLeastReach, kMostReach)) {}

void EdgeEnhancement::enhance(const PixelPlane& picture, PixelPlane& enhanced) const {
  const auto row_at = [&](int j) { return picture.data() + size_.row(std::clamp(j, 0, size_.height - 1)); };
  for_bands(size_, [&](int first, int end) {
    PaddedSums near(size_.width, reach_), wide(size_.width, reach_);
    for (int j = first; j < end; ++j) {
      near.begin();
      for (int k = j - 1; k <= j + 1; ++k) near.add(row_at(k));
      if (j > first)
        wide.move(row_at(j + reach_), row_at(j - reach_ - 1));
      else
        for (int k = j - reach_; k <= j + reach_; ++k) wide.add(row_at(k));
      enhanced_row(row_at(j), near.padded(), wide.padded(), {reach_, kStrength, kMostDarker, kMostLighter},
                   size_.width, enhanced.data() + size_.row(j));
    }
  });
}

}  // namespace xraycast
