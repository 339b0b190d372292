#include "xraycast/drawing/palette.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

constexpr std::size_t kColours = 256;

struct CountedColour {
  Rgb rgb;
  std::int64_t pixels;
};

/// Colours that share an entry of the palette.
struct ColourBox {
  std::span<CountedColour> colours;
  int widest = 0;    ///< the channel in which they differ most
  double error = 0;  ///< how much is gained by cutting it: that range, weighted by the pixels
};

ColourBox box_of(std::span<CountedColour> colours) {
  ColourBox box{colours};
  std::int64_t pixels = 0;
  for (const CountedColour& colour : colours) pixels += colour.pixels;
  for (int channel = 0; channel < 3; ++channel) {
    const auto [least, most] =
        std::ranges::minmax(colours, {}, [&](const CountedColour& colour) { return colour.rgb[channel]; });
    const double range = most.rgb[channel] - least.rgb[channel];
    // A step of two greys is seen over many pixels, one of twenty over few.
    const double error = range * range * std::sqrt(static_cast<double>(pixels));
    if (error > box.error) {
      box.error = error;
      box.widest = channel;
    }
  }
  return box;
}

/// Cuts a box so that half its pixels are on either side, as far as colours allow.
std::pair<ColourBox, ColourBox> halves_of(const ColourBox& box) {
  std::ranges::sort(box.colours, {}, [&](const CountedColour& colour) { return colour.rgb[box.widest]; });
  std::int64_t pixels = 0, before = 0;
  for (const CountedColour& colour : box.colours) pixels += colour.pixels;
  std::size_t cut = 0;
  while (cut + 1 < box.colours.size() && (cut == 0 || 2 * (before + box.colours[cut].pixels) <= pixels))
    before += box.colours[cut++].pixels;
  return {box_of(box.colours.first(cut)), box_of(box.colours.subspan(cut))};
}

Rgb mean_of(const ColourBox& box) {
  std::array<double, 3> sum{};
  double pixels = 0;
  for (const auto& [rgb, count] : box.colours) {
    for (int channel = 0; channel < 3; ++channel) sum[channel] += static_cast<double>(rgb[channel] * count);
    pixels += static_cast<double>(count);
  }
  Rgb mean{};
  for (int channel = 0; channel < 3; ++channel)
    mean[channel] = static_cast<std::uint8_t>(std::lround(sum[channel] / pixels));
  return mean;
}

std::uint32_t number_of(const Rgb& rgb) { return std::uint32_t{rgb[0]} << 16 | rgb[1] << 8 | rgb[2]; }

/// Each pixel's colour as a number.
std::vector<std::uint32_t> numbers_of(std::span<const std::uint8_t> rgb) {
  std::vector<std::uint32_t> numbers(rgb.size() / 3);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    numbers[i] = number_of({rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]});
  return numbers;
}

std::vector<CountedColour> counted_colours(std::vector<std::uint32_t> numbers) {
  std::ranges::sort(numbers);
  std::vector<CountedColour> colours;
  for (auto first = numbers.begin(); first != numbers.end();) {
    const auto last = std::upper_bound(first, numbers.end(), *first);
    const std::uint32_t number = *first;
    colours.push_back({{static_cast<std::uint8_t>(number >> 16), static_cast<std::uint8_t>(number >> 8),
                        static_cast<std::uint8_t>(number)},
                       last - first});
    first = last;
  }
  return colours;
}

}  // namespace

IndexedPicture with_palette(std::span<const std::uint8_t> rgb) {
  const std::vector<std::uint32_t> pixels = numbers_of(rgb);
  std::vector<CountedColour> colours = counted_colours(pixels);
  std::vector<ColourBox> boxes{box_of(colours)};
  while (boxes.size() < kColours) {
    const auto worst = std::ranges::max_element(boxes, {}, &ColourBox::error);
    if (worst->error == 0) break;  // each has one colour
    const auto [low, high] = halves_of(*worst);
    *worst = low;
    boxes.push_back(high);
  }

  IndexedPicture picture;
  std::vector<std::pair<std::uint32_t, std::uint8_t>> entries;  // the palette's entry of each colour
  for (const ColourBox& box : boxes) {
    for (const CountedColour& colour : box.colours)
      entries.emplace_back(number_of(colour.rgb), static_cast<std::uint8_t>(picture.palette.size()));
    picture.palette.push_back(mean_of(box));
  }
  std::ranges::sort(entries);
  picture.indices.resize(pixels.size());
  std::ranges::transform(pixels, picture.indices.begin(), [&](std::uint32_t number) {
    return std::ranges::lower_bound(entries, number, {}, [](const auto& entry) { return entry.first; })
        ->second;
  });
  return picture;
}

}  // namespace xraycast
