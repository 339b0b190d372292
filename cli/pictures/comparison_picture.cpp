#include "pictures/comparison_picture.hpp"

#include "xraycast/base/image.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace xraycast::cli {
namespace {

constexpr int kMargin = 12, kTop = 32, kCaption = 28, kFont = 15, kMinWidth = 240, kGain = 4;
constexpr Colour kInk{0.9, 0.9, 0.9};

std::vector<std::uint8_t> difference(const std::vector<std::uint8_t>& frame,
                                     const std::vector<std::uint8_t>& drr) {
  std::vector<std::uint8_t> greys(frame.size());
  std::ranges::transform(frame, drr, greys.begin(), [](int a, int b) {
    return static_cast<std::uint8_t>(std::clamp(128 + kGain * (a - b), 0, 255));
  });
  return greys;
}

/// One channel of a picture in which all are the same.
std::vector<std::uint8_t> greys_of(const std::vector<std::uint8_t>& rgb) {
  std::vector<std::uint8_t> greys(rgb.size() / 3);
  for (std::size_t i = 0; i < greys.size(); ++i) greys[i] = rgb[3 * i];
  return greys;
}

}  // namespace

void write_comparison_picture(const std::string& title, std::span<const float> frame_tau,
                              std::span<const float> drr_tau, int width, const std::filesystem::path& path) {
  const GreyWindow window = automatic_window(drr_tau);
  const std::vector<std::uint8_t> frame = windowed(frame_tau, window), drr = windowed(drr_tau, window);
  const std::array<std::vector<std::uint8_t>, 3> pictures{frame, drr, difference(frame, drr)};
  const std::array<std::string, 3> captions{"map", "true projection", fmt::format("difference x {}", kGain)};

  const int height = static_cast<int>(drr.size()) / width, pitch = std::max(width, kMinWidth) + kMargin;
  Canvas sheet(kMargin + 3 * pitch, kTop + height + kCaption, {0.11, 0.11, 0.11});
  sheet.text({kMargin, kTop - 10}, title, kFont, kInk);
  for (int i = 0; i < 3; ++i) {
    const double x = kMargin + i * pitch;
    sheet.picture(rgb_of(pictures[i]), width, height, {x, kTop, double(width), double(height)});
    sheet.text({x, kTop + height + kCaption - 9}, captions[i], kFont, kInk);
  }
  write_picture(greys_of(sheet.rgb()), sheet.width(), sheet.height(), 1, path);
}

}  // namespace xraycast::cli
