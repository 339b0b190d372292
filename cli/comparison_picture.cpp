#include "comparison_picture.hpp"

#include "xraycast/base/image.hpp"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace xraycast::cli {
namespace {

namespace Algo = OIIO::ImageBufAlgo;
constexpr int kMargin = 12, kTop = 32, kCaption = 28, kFont = 15, kMinWidth = 240, kGain = 4;

std::vector<std::uint8_t> difference(const std::vector<std::uint8_t>& frame,
                                     const std::vector<std::uint8_t>& drr) {
  std::vector<std::uint8_t> greys(frame.size());
  std::ranges::transform(frame, drr, greys.begin(), [](int a, int b) {
    return static_cast<std::uint8_t>(std::clamp(128 + kGain * (a - b), 0, 255));
  });
  return greys;
}

void text(OIIO::ImageBuf& sheet, int x, int y, const std::string& words) {
  Algo::render_text(sheet, x, y, words, kFont, "DejaVuSans", {0.9F});
}

}  // namespace

void write_comparison_picture(const std::string& title, std::span<const float> frame_tau,
                              std::span<const float> drr_tau, int width, const std::filesystem::path& path) {
  const GreyWindow window = automatic_window(drr_tau);
  const std::vector<std::uint8_t> frame = windowed(frame_tau, window), drr = windowed(drr_tau, window);
  const std::array<std::vector<std::uint8_t>, 3> pictures{frame, drr, difference(frame, drr)};
  const std::array<std::string, 3> captions{"map", "true projection", fmt::format("difference x {}", kGain)};

  const int height = static_cast<int>(drr.size()) / width, pitch = std::max(width, kMinWidth) + kMargin;
  OIIO::ImageBuf sheet(
      OIIO::ImageSpec(kMargin + 3 * pitch, kTop + height + kCaption, 1, OIIO::TypeDesc::UINT8));
  Algo::fill(sheet, {0.11F});
  text(sheet, kMargin, kTop - 10, title);
  for (int i = 0; i < 3; ++i) {
    OIIO::ImageBuf picture(OIIO::ImageSpec(width, height, 1, OIIO::TypeDesc::UINT8));
    picture.set_pixels(picture.roi(), OIIO::TypeDesc::UINT8, pictures[i].data());
    const int x = kMargin + i * pitch;
    Algo::paste(sheet, x, kTop, 0, 0, picture);
    text(sheet, x, kTop + height + kCaption - 9, captions[i]);
  }
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(sheet.spec().image_pixels()));
  sheet.get_pixels(sheet.roi(), OIIO::TypeDesc::UINT8, pixels.data());
  write_png(pixels, sheet.spec().width, sheet.spec().height, 1, path);
}

}  // namespace xraycast::cli
