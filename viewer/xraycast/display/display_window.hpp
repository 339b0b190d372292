#pragma once

#include "xraycast/display/display_loops.hpp"
#include "xraycast/display/picture_rows.hpp"

#include <cstdint>

namespace xraycast {

/// From black to white what the body shows between the blades, but for the darkest and the brightest pixels;
/// from frame to frame it follows slowly, so that nothing flickers. Where there is metal in the body (see
/// metal_depth.hpp), the window is the body's without it; the darkest greys are the metal's as far as it is
/// darker.
class DisplayWindow {
 public:
  explicit DisplayWindow(const PictureSize& size);

  /// The next frame has the window that fits it.
  void forget() { is_first_ = true; }

  /// Before a frame's rows: the logarithm of the open field, above which there is no body; what the body
  /// leaves of the beam in every pixel, without scatter and noise; and the share of the beam between the
  /// blades.
  void begin(double open_logarithm, const PixelPlane& left, const PixelPlane& field);

  /// Row j; rows in any order, those of a band on one thread. `logarithm` is the detector's, `shown` what is
  /// windowed, `left` and `field` as begin() takes them.
  void count_row(int j, const float* logarithm, const float* shown, const float* left, const float* field);

  /// After all rows. A picture without a body leaves it as it is.
  void follow();

  /// Of what is shown of the body.
  float middle() const { return middle_; }
  float width() const { return width_; }

  /// The body's greys, and those of what is darker. The larger of both is shown: they are the same without
  /// metal, and with it the second is flatter.
  GreyLine body() const;
  GreyLine metal() const;

 private:
  PictureSize size_;
  float body_below_ = 0, metal_below_ = 0, middle_ = 0, width_;
  float greys_ = 0;  ///< the share that is metal's
  float depth_ = 0;  ///< of the metal below the body's window, as far as it is shown
  bool is_first_ = true;
  std::vector<std::uint32_t> counts_, metal_counts_;  ///< of each band
};

}  // namespace xraycast
