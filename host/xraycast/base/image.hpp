#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// The value that `share` of the values, of which there is one at least, do not exceed.
float quantile(std::vector<float> values, double share);

/// The optical depth of an image's denser parts: the 90th percentile of all pixels that are not air.
double typical_depth(std::span<const float> tau);

/// The range of optical depths that is displayed: grey is 0 at `dark` and 1 at `light` of exp(-tau / scale),
/// then raised to 1 / gamma, and inverted when `inverted`, so that bone is bright. `light` is above `dark`.
struct GreyWindow {
  double scale = 1, dark = 0, light = 1;
  double gamma = 1;
  bool inverted = false;

  double grey(double tau) const;
  bool operator==(const GreyWindow&) const = default;
};

/// An automatic window, with this gamma, inverted or not: exp(-tau / s) from slightly below the image's
/// darkest to its lightest value, with s twice the depth of its denser parts, which is close to the
/// logarithmic display of a radiograph. An image whose denser parts are below `least_depth` is shown as if
/// they were at it, and so stays faint.
GreyWindow automatic_window(std::span<const float> tau, double gamma = 1, bool inverted = false,
                            double least_depth = 0);

/// Grey 0 to 255 in the automatic window: a chest's plain exp(-tau) is nearly black.
std::vector<std::uint8_t> windowed_transmission(std::span<const float> tau, double least_depth = 0);

/// Grey 0 to 255 in a window.
std::vector<std::uint8_t> windowed(std::span<const float> tau, const GreyWindow& window);

/// The same greys as RGB.
std::vector<std::uint8_t> rgb_of(std::span<const std::uint8_t> greys);

/// Grey 0 to 255 of exp(-tau), unscaled.
std::vector<std::uint8_t> plain_transmission(std::span<const float> tau);

}  // namespace xraycast
