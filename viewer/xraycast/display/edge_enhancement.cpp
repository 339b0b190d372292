#include "xraycast/display/edge_enhancement.hpp"

#include "xraycast/display/display_loops.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace xraycast {
namespace {

constexpr double kReach_mm = 1.5;
constexpr int kLeastReach = 2, kMostReach = 20;

/// The sums of columns with what the picture goes on with on both sides.
class PaddedSums {
 public:
  PaddedSums(int width, int reach) : width_(width), reach_(reach), all_(width + 2 * std::size_t(reach)) {}

  void add_up(std::span<const float* const> rows) {
    float* const sums = all_.data() + reach_;
    std::copy_n(rows.front(), width_, sums);
    for (const float* row : rows.subspan(1)) added_row(row, width_, sums);
    std::fill_n(all_.data(), reach_, sums[0]);
    std::fill_n(sums + width_, reach_, sums[width_ - 1]);
  }
  /// Of the picture's first column.
  const float* data() const { return all_.data() + reach_; }

 private:
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
    std::vector<const float*> rows;
    for (int j = first; j < end; ++j) {
      rows.clear();
      for (int k = j - reach_; k <= j + reach_; ++k) rows.push_back(row_at(k));
      wide.add_up(rows);
      near.add_up(std::span(rows).subspan(static_cast<std::size_t>(reach_) - 1, 3));
      enhanced_row(row_at(j), near.data(), wide.data(), {reach_, kStrength, kMost}, size_.width,
                   enhanced.data() + size_.row(j));
    }
  });
}

}  // namespace xraycast
