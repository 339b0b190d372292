#pragma once

#include "xraycast/projection/pinhole_camera.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// An X-ray picture, height x width, row 0 on top, in any brightness and contrast; and the camera that took
/// it, where something is known of it.
struct Xray {
  std::string name;  ///< for messages
  int width = 0, height = 0;
  std::vector<float> pixels;
  std::optional<PinholeCamera> camera{};  ///< intrinsics, and RT as far as it is known; of the same size
};

/// Throws InputError, with the picture's name in front, for a size that is none, pixels that are not finite
/// or all one value, and a camera of another size.
void check(const Xray& xray);

/// The part of a picture that X-rays reached, 1 or 0 a pixel: not the collimator, which shows as pixels of
/// almost one grey along the border of the picture, nor what that encloses.
std::vector<std::uint8_t> collimated_field(const Xray& xray);

}  // namespace xraycast
