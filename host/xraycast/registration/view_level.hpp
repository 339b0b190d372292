#pragma once

#include "xraycast/registration/edge_filter.hpp"
#include "xraycast/registration/tone_curve.hpp"
#include "xraycast/registration/xray.hpp"

#include <cstdint>
#include <vector>

namespace xraycast {

/// An X-ray at one resolution.
struct ViewLevel {
  PinholeCamera camera;  ///< of the part of the picture that counts, in its pixels
  /// Depths of the middle of its pixels, passed through (share, 1 - 2 share, share) along rows and columns,
  /// are nearly means over the pixels, as the X-ray's are.
  double share = 0;
  std::vector<std::uint8_t> counted;  ///< pixels that are compared
  std::vector<float> greys;           ///< shares, greys, from the darkest to the lightest of the picture
  Edges edges;                        ///< of depths by a tone curve, which grow with what attenuates
};

/// Means over factor x factor pixels of the part of the picture's mask within the box. Throws InputError,
/// with the picture's name in front, when less than 16 x 16 pixels are left.
struct PictureBox {
  int left = 0, top = 0, right = 0, bottom = 0;  ///< the last two are one beyond
};
ViewLevel level_of(const Xray& xray, const std::vector<std::uint8_t>& mask, const PictureBox& box, int factor,
                   const ToneCurve& tone);

/// Means over pixels of depths in their middle.
std::vector<float> spread(std::vector<float> depths, const ViewLevel& level);

}  // namespace xraycast
