#pragma once

#include "xraycast/fluoroscope/subtraction.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// A recorded run of digital subtraction angiography, frame by frame.
class AngiographyRun {
 public:
  AngiographyRun(int width, int height, PixelShift mask_shift, bool shows_maximum_opacification);

  /// The next frame as 8-bit RGB; those of the mask are averaged. `opacified_tau` is what an opacified vessel
  /// adds: the window follows it until the mask is complete, and then stays.
  std::vector<std::uint8_t> picture(std::span<const float> frame, bool is_mask, double opacified_tau);

 private:
  Subtraction subtraction_;
  MaximumOpacification opacified_;
  SubtractionWindow window_;
  bool shows_maximum_;
};

}  // namespace xraycast
