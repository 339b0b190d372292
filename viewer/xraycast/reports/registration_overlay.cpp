#include "xraycast/reports/registration_overlay.hpp"

#include "xraycast/base/image.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/registration/edge_filter.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace xraycast {
namespace {

constexpr int kMostPixels = 600, kPanels = 4, kSquares = 8;

/// Greys 0 to 1 of one size.
struct Plate {
  int width, height;
  std::vector<float> greys;
};

/// Between the darkest and the lightest pixels, but for a hundredth; inverted where bone is bright, and
/// logarithmic where that is what fits the projection.
void stretch(Plate& plate, Tone tone) {
  const bool is_inverted = tone == Tone::inverted_intensity || tone == Tone::inverted_log_intensity,
             is_log = tone == Tone::log_intensity || tone == Tone::inverted_log_intensity;
  constexpr float kOffset = 0.03F;  // as X-rays are compared
  const float low = quantile(plate.greys, 0.01), high = quantile(plate.greys, 0.99);
  for (float& grey : plate.greys) {
    grey = std::clamp((grey - low) / std::max(high - low, 1e-12F), 0.F, 1.F);
    if (is_inverted) grey = 1 - grey;
    if (is_log) grey = std::log(1 + grey / kOffset) / std::log(1 + 1 / kOffset);
  }
}

Plate plate_of(const Xray& xray, int factor, Tone tone) {
  Plate plate{xray.width / factor, xray.height / factor, {}};
  for (int y = 0; y < plate.height; ++y)
    for (int x = 0; x < plate.width; ++x) {
      float sum = 0;
      for (int j = 0; j < factor; ++j)
        for (int i = 0; i < factor; ++i)
          sum += xray.pixels[static_cast<std::size_t>(y * factor + j) * static_cast<std::size_t>(xray.width) +
                             static_cast<std::size_t>(x * factor + i)];
      plate.greys.push_back(sum);
    }
  stretch(plate, tone);
  return plate;
}

/// 0 to 1: the strongest twentieth of a projection's edges, the others less.
std::vector<float> edge_strength(const std::vector<float>& depths, const Plate& plate) {
  const Edges edges = edges_of(depths, plate.width, plate.height);
  std::vector<float> strength, shown;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    strength.push_back(std::hypot(edges.across[i], edges.down[i]));
    if (depths[i] > 0) shown.push_back(strength.back());
  }
  if (shown.empty()) return strength;
  std::ranges::sort(shown);
  const float strong = std::max(shown[shown.size() - 1 - shown.size() / 20], 1e-12F);
  for (float& s : strength) {
    const float share = std::min(s / strong, 1.F);
    s = share * share;
  }
  return strength;
}

std::uint8_t byte(float share) { return static_cast<std::uint8_t>(std::lround(255 * share)); }

void put(RgbPicture& picture, int x, int y, float red, float green, float blue) {
  const std::size_t at = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                              static_cast<std::size_t>(x));
  picture.rgb[at] = byte(red);
  picture.rgb[at + 1] = byte(green);
  picture.rgb[at + 2] = byte(blue);
}

}  // namespace

RgbPicture registration_overlay(std::span<const Xray> xrays, const Registration& pose,
                                const ResidentScan& scan, const Opacity& opacity, Progress& progress) {
  std::vector<int> factors;
  RgbPicture picture{0, 0, {}};
  for (const Xray& xray : xrays) {
    factors.push_back((std::max(xray.width, xray.height) + kMostPixels - 1) / kMostPixels);
    picture.width = std::max(picture.width, kPanels * (xray.width / factors.back()));
    picture.height += xray.height / factors.back();
  }
  picture.rgb.assign(3 * static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height),
                     0);
  int top = 0;
  for (std::size_t v = 0; v < xrays.size(); ++v) {
    const Registration::View& view = pose.views[v];
    const Plate xray = plate_of(xrays[v], factors[v], view.tone);
    const std::vector<float> depths = project(
        scan, of_means(view.camera, {0, 0}, factors[v], {xray.width, xray.height}), opacity, progress);
    const std::vector<std::uint8_t> drr = windowed_transmission(depths);
    const std::vector<float> edges = edge_strength(depths, xray);
    for (int y = 0; y < xray.height; ++y)
      for (int x = 0; x < xray.width; ++x) {
        const std::size_t i =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(xray.width) + static_cast<std::size_t>(x);
        const float grey = xray.greys[i], projected = static_cast<float>(drr[i]) / 255, edge = edges[i];
        const bool is_drr = (x * kSquares / xray.width + y * kSquares / xray.height) % 2 == 1;
        const float mixed = is_drr ? projected : grey;
        put(picture, x, top + y, grey, grey, grey);
        put(picture, xray.width + x, top + y, projected, projected, projected);
        put(picture, 2 * xray.width + x, top + y, grey + edge * (1 - grey), grey * (1 - edge),
            grey * (1 - edge));
        put(picture, 3 * xray.width + x, top + y, mixed, mixed, mixed);
      }
    top += xray.height;
  }
  return picture;
}

}  // namespace xraycast
