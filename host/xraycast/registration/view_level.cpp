#include "xraycast/registration/view_level.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace xraycast {
GreyRange grey_range(const Xray& xray, const std::vector<std::uint8_t>& mask) {
  std::vector<float> greys;
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (mask[i] != 0) greys.push_back(xray.pixels[i]);
  const float dark = quantile(greys, 0.002), light = quantile(std::move(greys), 0.998);
  return {dark, std::max(light, std::nextafter(dark, HUGE_VALF))};
}

PinholeCamera camera_of(const ViewLevel& level, const PictureBox& box) {
  return of_means(level.camera, {box.left, box.top}, 1, {box.right - box.left, box.bottom - box.top});
}

ViewLevel part_of(const ViewLevel& level, const PictureBox& box) {
  ViewLevel part{
      .camera = camera_of(level, box), .share = level.share, .counted = {}, .greys = {}, .edges = {}};
  const auto cut = [&](const auto& from, auto& to) {
    to.reserve(static_cast<std::size_t>(part.camera.width) * static_cast<std::size_t>(part.camera.height));
    for (int y = box.top; y < box.bottom; ++y) {
      const auto row = from.begin() + std::ptrdiff_t{y} * level.camera.width;
      to.insert(to.end(), row + box.left, row + box.right);
    }
  };
  cut(level.counted, part.counted);
  cut(level.greys, part.greys);
  cut(level.edges.across, part.edges.across);
  cut(level.edges.down, part.edges.down);
  return part;
}

ViewLevel level_of(const Xray& xray, const std::vector<std::uint8_t>& mask, const GreyRange& range,
                   const PictureBox& box, int factor, const ToneCurve& tone) {
  const int width = (box.right - box.left) / factor, height = (box.bottom - box.top) / factor;
  if (width < 16 || height < 16)
    throw InputError("{}: less than 16 x 16 pixels of it show the scan", xray.name);
  ViewLevel level{.camera = of_means(xray.camera.value(), {box.left, box.top}, factor, {width, height}),
                  .share = (1 - 1 / (1.0 * factor * factor)) / 24,
                  .counted = {},
                  .greys = {},
                  .edges = {}};
  std::vector<std::uint8_t> inside;
  std::vector<float> depths;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      int count = 0;
      for (int j = 0; j < factor; ++j)
        for (int i = 0; i < factor; ++i) {
          const auto at =
              static_cast<std::size_t>(box.top + y * factor + j) * static_cast<std::size_t>(xray.width) +
              static_cast<std::size_t>(box.left + x * factor + i);
          if (mask[at] == 0) continue;
          sum += range.share(xray.pixels[at]);
          ++count;
        }
      inside.push_back(count == factor * factor);
      level.greys.push_back(count > 0 ? static_cast<float>(sum / count) : 0);
      depths.push_back(tone(level.greys.back()));
    }
  level.counted = within_filter(inside, width, height);
  level.edges = edges_of(depths, width, height);
  return level;
}

std::vector<float> spread(std::vector<float> depths, const ViewLevel& level) {
  if (level.share == 0) return depths;
  const int width = level.camera.width, height = level.camera.height;
  const auto aside = static_cast<float>(level.share), own = 1 - 2 * aside;
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  std::vector<float> rows(depths.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      rows[at(x, y)] = own * depths[at(x, y)] + aside * (depths[at(std::max(x - 1, 0), y)] +
                                                         depths[at(std::min(x + 1, width - 1), y)]);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      depths[at(x, y)] = own * rows[at(x, y)] +
                         aside * (rows[at(x, std::max(y - 1, 0))] + rows[at(x, std::min(y + 1, height - 1))]);
  return depths;
}

}  // namespace xraycast
