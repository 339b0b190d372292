#include "xraycast/base/image.hpp"

#include "xraycast/base/metal_depth.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

std::uint8_t grey(double share) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(share, 0.0, 1.0)));
}

constexpr float kMatter = 0.05f;  // lower values are air and cloth, which do not affect the window

/// The depths that are not metal's.
std::vector<float> without_metal(std::span<const float> tau) {
  DepthCounts counts;
  for (const float t : tau)
    if (t > kMatter) counts.add(t);
  std::vector<float> anatomy;
  const std::optional<float> metal = counts.metal_from();
  std::ranges::copy_if(tau, std::back_inserter(anatomy), [&](float t) { return !metal || t <= *metal; });
  return anatomy;
}

}  // namespace

float quantile(std::vector<float> values, double share) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, nth);
  return *nth;
}

double typical_depth(std::span<const float> tau) {
  std::vector<float> matter;
  std::ranges::copy_if(tau, std::back_inserter(matter), [](float t) { return t > kMatter; });
  return matter.empty() ? double{kMatter} : quantile(std::move(matter), 0.9);
}

double GreyWindow::grey(double tau) const {
  const double linear = std::clamp((std::exp(-tau / scale) - dark) / (light - dark), 0.0, 1.0);
  const double bent = std::pow(linear, 1 / gamma);
  return inverted ? 1 - bent : bent;
}

GreyWindow automatic_window(std::span<const float> tau, double gamma, bool inverted, double least_depth) {
  const std::vector<float> all = without_metal(tau);
  const double scale = 2 * std::max(typical_depth(all), least_depth);
  constexpr double kHeadroom = 1.15;  // keeps the darkest parts above black, where contrast is lost
  const double light = std::exp(-quantile(all, 0.001) / scale);
  return {scale, std::min(std::exp(-kHeadroom * quantile(all, 0.999) / scale), 0.8 * light), light, gamma,
          inverted};
}

std::vector<std::uint8_t> windowed_transmission(std::span<const float> tau, double least_depth) {
  return windowed(tau, automatic_window(tau, 1, false, least_depth));
}

std::vector<std::uint8_t> windowed(std::span<const float> tau, const GreyWindow& window) {
  std::vector<std::uint8_t> greys(tau.size());
  std::ranges::transform(tau, greys.begin(), [&](float t) { return grey(window.grey(t)); });
  return greys;
}

std::vector<std::uint8_t> rgb_of(std::span<const std::uint8_t> greys) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * greys.size());
  for (const std::uint8_t grey : greys) rgb.insert(rgb.end(), 3, grey);
  return rgb;
}

std::vector<std::uint8_t> plain_transmission(std::span<const float> tau) {
  std::vector<std::uint8_t> greys(tau.size());
  std::ranges::transform(tau, greys.begin(), [](float t) { return grey(std::exp(-t)); });
  return greys;
}

}  // namespace xraycast
