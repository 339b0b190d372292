#pragma once

#include "xraycast/display/cell_ramps.hpp"

#include <cstdint>
#include <vector>

namespace xraycast {

/// Averages a display's frames over time, so that their noise falls, except where something moves: a wire
/// that has moved would leave most of its contrast behind.
///
/// What moves is found in the difference from the average so far, summed over 3 x 3 pixels, as lines of some
/// 17 pixels in eight directions: a wire adds up along them, and noise does not. The measure is how much of a
/// line there is nearby, of noise, so that it needs neither dose nor contrast. The sides of what has moved,
/// which no line runs along, are taken with it: else its outline would stay.
class TemporalFilter {
 public:
  explicit TemporalFilter(const PictureSize& size);

  /// The next frame is shown as it is.
  void forget() { is_first_ = true; }

  /// The next frame, a logarithm a pixel. Sums over 3 x 3 pixels that change by less than 0.001 are no
  /// motion, and a change by more than 3.6 counts as 3.6.
  void add(const PixelPlane& frame);

  const PixelPlane& average() const { return average_; }

 private:
  void subtract(const PixelPlane& frame);
  void find_lines();
  void follow_noise();
  void find_moved();

  PictureSize size_;
  CellRamps ramps_;
  bool is_first_ = true, is_noise_new_ = true;
  PixelPlane average_;
  PixelPlane difference_;             ///< with a margin of pixels of 0
  std::vector<std::int16_t> summed_;  ///< it over 3 x 3 pixels, with a margin of kLineReach pixels of 0
  std::vector<std::int16_t> lines_;   ///< the strongest line through each pixel
  PixelPlane means_;                  ///< of it in each cell
  PixelPlane usual_;                  ///< what of it noise makes there, as far as earlier frames tell
  std::vector<std::uint8_t> moved_;   ///< pixels where lines are far above it, with a margin
  std::vector<std::uint8_t> beside_;  ///< those in the same row beside one
};

}  // namespace xraycast
