#pragma once

#include "xraycast/registration/edge_filter.hpp"
#include "xraycast/registration/tone_curve.hpp"
#include "xraycast/registration/xray.hpp"

#include <algorithm>
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

struct PictureBox {
  int left = 0, top = 0, right = 0, bottom = 0;  ///< the last two are one beyond
};

/// Greys between the darkest and the lightest pixel of a picture's mask, but for a few, become 0 to 1.
struct GreyRange {
  float dark = 0, light = 1;
  float share(float grey) const { return std::clamp((grey - dark) / (light - dark), 0.F, 1.F); }
};
GreyRange grey_range(const Xray& xray, const std::vector<std::uint8_t>& mask);

/// Means over factor x factor pixels of the part of the picture's mask within the box. Throws InputError,
/// with the picture's name in front, when less than 16 x 16 pixels are left.
ViewLevel level_of(const Xray& xray, const std::vector<std::uint8_t>& mask, const GreyRange& range,
                   const PictureBox& box, int factor, const ToneCurve& tone);

/// The part of a level within a box of its pixels, and its camera alone.
ViewLevel part_of(const ViewLevel& level, const PictureBox& box);
PinholeCamera camera_of(const ViewLevel& level, const PictureBox& box);

/// Means over pixels of depths in their middle.
std::vector<float> spread(std::vector<float> depths, const ViewLevel& level);

}  // namespace xraycast
