#pragma once

#include "xraycast/display/picture_rows.hpp"

#include <cstdint>
#include <vector>

namespace xraycast {

/// What a detector's codes are of: above `dark` the signal, whose variance is that of the electronics, and
/// that of quanta in proportion to it. All in codes.
struct CodeNoise {
  float dark = 0, electronic = 0, per_code = 0;
  bool operator==(const CodeNoise&) const = default;
};

/// Where few quanta come through, as behind a pelvis seen from the side, noise is a large share of the
/// signal, and its logarithm has black specks. There a pixel is drawn towards the mean of 5 x 5 pixels, so
/// far that the noise is at most 0.15 of that mean, and never below a fifth of it. All others stay as
/// they are.
class StarvedPixels {
 public:
  explicit StarvedPixels(const PictureSize& size) : size_(size), calmed_(size.pixels()) {}

  void set_noise(const CodeNoise& noise) { noise_ = noise; }

  /// The logarithms of codes above dark, which `logarithm` has too: itself where no pixel is starved; else
  /// valid until the next call.
  const PixelPlane& calmed(const std::vector<std::uint16_t>& codes, const PixelPlane& logarithm);

 private:
  void calm_row(int j, const std::vector<std::uint16_t>& codes, float starved_below);

  PictureSize size_;
  CodeNoise noise_;
  std::vector<char> is_starved_;  ///< rows with such pixels
  PixelPlane calmed_;
};

}  // namespace xraycast
