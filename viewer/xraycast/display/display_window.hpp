#pragma once

#include "xraycast/display/picture_rows.hpp"

#include <cstdint>

namespace xraycast {

/// From black to white what the body shows between the blades, but for the darkest and the brightest pixels;
/// from frame to frame it follows slowly, so that nothing flickers.
class DisplayWindow {
 public:
  explicit DisplayWindow(const PictureSize& size);

  /// The next frame has the window that fits it.
  void forget() { is_first_ = true; }

  /// Before a frame's rows: the logarithm of the open field, above which there is no body.
  void begin(double open_logarithm);

  /// Row j; rows in any order, those of a band on one thread. `logarithm` is the detector's, `shown` what is
  /// windowed, `field` the share of the beam between the blades.
  void count_row(int j, const float* logarithm, const float* shown, const float* field);

  /// After all rows. A picture without a body leaves it as it is.
  void follow();

  float middle() const { return middle_; }
  float width() const { return width_; }

 private:
  PictureSize size_;
  float body_below_ = 0, middle_ = 0, width_;
  bool is_first_ = true;
  std::vector<std::uint32_t> counts_;  ///< of each band
};

}  // namespace xraycast
