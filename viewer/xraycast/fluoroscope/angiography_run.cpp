#include "xraycast/fluoroscope/angiography_run.hpp"

#include <algorithm>

namespace xraycast {

AngiographyRun::AngiographyRun(int width, int height, PixelShift mask_shift, bool shows_maximum_opacification)
    : subtraction_(width, height), shows_maximum_(shows_maximum_opacification) {
  subtraction_.shift_mask(mask_shift);
}

std::vector<std::uint8_t> AngiographyRun::picture(std::span<const float> frame, bool is_mask,
                                                  double opacified_tau) {
  if (is_mask) {
    constexpr double kLeast = 0.01;
    subtraction_.add_to_mask(frame);
    window_.black = std::max(kLeast, opacified_tau);
  }
  std::vector<float> difference(frame.size());
  subtraction_.subtract(frame, difference);
  if (!shows_maximum_ || is_mask) return subtraction_picture(difference, window_);
  opacified_.add(difference);
  return subtraction_picture(opacified_.picture(), window_);
}

}  // namespace xraycast
