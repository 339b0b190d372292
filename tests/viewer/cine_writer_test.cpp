#include "xraycast/drawing/cine_writer.hpp"

#include "support/pictures.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <gif_lib.h>
#include <memory>
#include <random>

namespace xraycast::cine_writer_test {
namespace {

constexpr int kWidth = 61, kHeight = 40;

/// A GIF's frames as RGB, by giflib's reader.
std::vector<std::vector<std::uint8_t>> frames_of(const std::filesystem::path& path,
                                                 std::vector<int>* delays = nullptr) {
  const auto close = [](GifFileType* gif) { DGifCloseFile(gif, nullptr); };
  const std::unique_ptr<GifFileType, decltype(close)> gif(DGifOpenFileName(path.c_str(), nullptr), close);
  std::vector<std::vector<std::uint8_t>> frames;
  if (!gif || DGifSlurp(gif.get()) != GIF_OK) return frames;
  EXPECT_EQ(gif->SWidth, kWidth);
  EXPECT_EQ(gif->SHeight, kHeight);
  for (int i = 0; i < gif->ImageCount; ++i) {
    GraphicsControlBlock control{};
    DGifSavedExtensionToGCB(gif.get(), i, &control);
    if (delays)
      delays->push_back(control.DelayTime);
    else
      EXPECT_EQ(control.DelayTime, 5);  // hundredths of a second
    const SavedImage& image = gif->SavedImages[i];
    std::vector<std::uint8_t>& rgb = frames.emplace_back();
    for (int pixel = 0; pixel < kWidth * kHeight; ++pixel) {
      const GifColorType& colour = image.ImageDesc.ColorMap->Colors[image.RasterBits[pixel]];
      rgb.insert(rgb.end(), {colour.Red, colour.Green, colour.Blue});
    }
  }
  return frames;
}

/// All greys, in noise, and so in every frame.
std::vector<std::uint8_t> grey_frame(unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> rgb;
  for (int i = 0; i < kWidth * kHeight; ++i) rgb.insert(rgb.end(), 3, static_cast<std::uint8_t>(random()));
  return rgb;
}

TEST(CineWriter, AnimationKeepsGreyFramesAsTheyAre) {
  const TemporaryFolder folder;
  CineWriter writer(folder / "turn.gif", kWidth, kHeight);
  for (const unsigned seed : {1, 2, 3}) writer.add(grey_frame(seed));
  EXPECT_FALSE(std::filesystem::exists(folder / "turn.gif")) << "not before it is whole";
  writer.finish();
  EXPECT_THAT(frames_of(folder / "turn.gif"),
              testing::ElementsAre(grey_frame(1), grey_frame(2), grey_frame(3)));
}

TEST(CineWriter, AnimationShowsFramesForTheirTime) {
  const TemporaryFolder folder;
  CineWriter writer(folder / "turn.gif", kWidth, kHeight, 1 / 30.0);
  for (const unsigned seed : {1, 2, 3, 4, 5, 6}) writer.add(grey_frame(seed));
  writer.finish();
  std::vector<int> delays;
  frames_of(folder / "turn.gif", &delays);
  // Whole hundredths of a second, which add up to a fifth.
  EXPECT_THAT(delays, testing::ElementsAre(3, 4, 3, 3, 4, 3));
}

TEST(CineWriter, AnimationComesCloseToEveryColour) {
  // Greys with a red of all shades across them, as vessels are drawn in.
  std::vector<std::uint8_t> rgb = grey_frame(5);
  for (int i = 0; i < kWidth * 10; ++i) {
    rgb[3 * i] = static_cast<std::uint8_t>(80 + i % 176);
    rgb[3 * i + 1] = rgb[3 * i + 2] = static_cast<std::uint8_t>(i % 176 / 2);
  }
  const TemporaryFolder folder;
  CineWriter writer(folder / "turn.gif", kWidth, kHeight);
  writer.add(rgb);
  writer.finish();
  const auto frames = frames_of(folder / "turn.gif");
  ASSERT_EQ(frames.size(), 1u);
  int worst = 0;
  for (std::size_t i = 0; i < rgb.size(); ++i) worst = std::max(worst, std::abs(rgb[i] - frames[0][i]));
  // 256 greys and 176 reds share 256 entries: two greys or reds an entry, four where cuts fall unevenly.
  EXPECT_LE(worst, 4);
}

TEST(CineWriter, FolderHoldsFramesAsTheyCome) {
  const TemporaryFolder folder;
  CineWriter writer(folder / "", kWidth, kHeight);
  writer.add(grey_frame(1));
  EXPECT_EQ(read_png(folder / "frame-000.png").values, grey_frame(1));
}

TEST(CineWriter, AbandonedAnimationLeavesNothing) {
  const TemporaryFolder folder;
  CineWriter(folder / "turn.gif", kWidth, kHeight).add(grey_frame(1));
  EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
}

}  // namespace
}  // namespace xraycast::cine_writer_test
