#include "xraycast/base/picture_file.hpp"

#include "support/pictures.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_formats.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <random>
#include <sstream>
#include <thread>

namespace xraycast::picture_file_test {
namespace {

constexpr int kWidth = 64, kHeight = 48;

/// Smooth, so that what compresses with loss comes close.
std::vector<std::uint8_t> smooth_picture(int channels) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      for (int c = 0; c < channels; ++c) pixels.push_back(static_cast<std::uint8_t>(3 * x + y / (c + 1)));
  return pixels;
}

std::vector<std::string> offered_extensions() {
  std::vector<std::string> extensions;
  std::istringstream words(picture_extensions());
  for (std::string word; words >> word;) extensions.push_back(word.substr(0, word.find(',')));
  return extensions;
}

TEST(PictureFile, EveryOfferedFormatReadsBack) {
  const TemporaryFolder folder;
  EXPECT_THAT(offered_extensions(), testing::IsSupersetOf({".png", ".jpg", ".tif", ".gif", ".hdr", ".webp"}));
  for (const std::string& extension : offered_extensions())
    for (const int channels : {1, 3}) {
      SCOPED_TRACE(extension);
      const std::vector<std::uint8_t> pixels = smooth_picture(channels);
      write_picture(pixels, kWidth, kHeight, channels, folder / ("p" + extension));
      const RgbPicture read = read_fitted(folder / ("p" + extension), kWidth, kHeight);
      ASSERT_EQ(read.rgb.size(), std::size_t{3} * kWidth * kHeight);
      int worst = 0;
      for (std::size_t i = 0; i < read.rgb.size(); ++i)
        worst = std::max(worst, std::abs(read.rgb[i] - pixels[channels == 1 ? i / 3 : i]));
      // JPEG quantises blocks, WebP and HDR colours, GIF has 255 of them for the picture's thousands.
      const bool has_loss = extension == ".jpg" || extension == ".jpeg" || extension == ".webp" ||
                            extension == ".hdr" || extension == ".gif";
      EXPECT_LE(worst, has_loss ? 16 : 0);
    }
}

TEST(PictureFile, OfAnotherNameIsRefusedWithThoseThatWork) {
  const TemporaryFolder folder;
  for (const char* name : {"p.xyz", "p", ".png", "p.png.txt", "p.exr"}) {
    EXPECT_FALSE(is_picture_name(name)) << name;
    try {
      check_picture_name(folder / name, "--plot p");
      FAIL() << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::StartsWith("--plot p: a picture's name must end in .png, .jpg, "));
    }
  }
  EXPECT_THROW(write_picture(smooth_picture(1), kWidth, kHeight, 1, folder / "p.xyz"), InputError);
  EXPECT_TRUE(is_picture_name("p.JPG"));
}

TEST(PictureFile, IsFittedIntoABox) {
  const TemporaryFolder folder;
  write_picture(smooth_picture(3), kWidth, kHeight, 3, folder / "p.png");
  for (const auto& [width, height] : {std::pair{32, 100}, std::pair{100, 24}}) {
    const RgbPicture read = read_fitted(folder / "p.png", width, height);
    EXPECT_EQ(read.width, 32);
    EXPECT_EQ(read.height, 24);
  }
}

TEST(PictureFile, FittedKeepsItsMean) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> greys;  // a chequerboard
  for (int i = 0; i < 80 * 40; ++i) greys.push_back((i + i / 80) % 2 == 0 ? 0 : 200);
  write_picture(greys, 80, 40, 1, folder / "board.png");
  const RgbPicture read = read_fitted(folder / "board.png", 20, 20);
  EXPECT_EQ(read.rgb.size(), std::size_t{3} * 20 * 10);
  // The mean, but for the filter's rounding and its few samples at the border.
  EXPECT_THAT(read.rgb, testing::Each(testing::AllOf(testing::Ge(90), testing::Le(110))));
}

TEST(PictureFile, ThatCannotBeReadIsNamed) {
  const TemporaryFolder folder;
  write_whole_file(folder / "text.png", "no picture");
  for (const char* name : {"none.png", "text.png"}) try {
      read_fitted(folder / name, 10, 10);
      FAIL() << "read";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), testing::StartsWith((folder / name).string() + ": could not be read: "));
      EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
    }
}

std::vector<FloatPicture> float_pictures(bool is_half) {
  std::vector<FloatPicture> pictures;
  for (int k = 0; k < 2; ++k) {
    pictures.push_back({.name = "layer " + std::to_string(k),
                        .width = 7,
                        .height = 20,
                        .channels = {"water", "bone"},
                        .is_half = is_half,
                        .attributes = {{"compression", "zips"}, {"a:number", k}, {"a:text", "tau"}}});
    for (int i = 0; i < 2 * 7 * 20; ++i)
      pictures.back().values.push_back(is_half ? 0.25f * static_cast<float>(i)
                                               : 0.1f * static_cast<float>(i));
  }
  return pictures;
}

/// W x H values.
std::vector<float> channel_of(const FloatPicture& picture, const std::string& name) {
  const auto at = std::ranges::find(picture.channels, name) - picture.channels.begin();
  std::vector<float> values;
  for (auto i = static_cast<std::size_t>(at); i < picture.values.size(); i += picture.channels.size())
    values.push_back(picture.values[i]);
  return values;
}

void expect_same(const std::vector<FloatPicture>& read, const std::vector<FloatPicture>& written) {
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t k = 0; k < read.size(); ++k) {
    EXPECT_EQ(read[k].width, written[k].width);
    EXPECT_EQ(read[k].height, written[k].height);
    EXPECT_EQ(read[k].is_half, written[k].is_half);
    for (const char* name : {"a:number", "a:text"})
      EXPECT_EQ(read[k].attributes.at(name), written[k].attributes.at(name)) << name;
    for (const char* channel : {"water", "bone"})
      EXPECT_EQ(channel_of(read[k], channel), channel_of(written[k], channel)) << channel;
  }
}

constexpr auto kAcceptAll = [](std::span<const FloatPicture>) {};

TEST(PictureFile, OpenImageIoAndTheSmallFormatsReadEachOthersExr) {
  const TemporaryFolder folder;
  const PictureFormats& small = small_picture_formats();
  for (const bool is_half : {false, true}) {
    const std::vector<FloatPicture> pictures = float_pictures(is_half);
    write_float_pictures(pictures, folder / "large.exr", ".exr");
    write_bytes(folder / "small.exr", small.bytes_of(pictures, ".exr"));
    for (const char* name : {"large.exr", "small.exr"}) {
      SCOPED_TRACE(name);
      expect_same(read_exr(folder / name), pictures);
      expect_same(small.read_exr((folder / name).string(), kAcceptAll), pictures);
    }
  }
}

TEST(PictureFile, SmallFormatsMakePngs) {
  const TemporaryFolder folder;
  for (const int channels : {1, 3}) {
    const std::vector<std::uint8_t> pixels = smooth_picture(channels);
    write_bytes(folder / "p.png",
                small_picture_formats().bytes_of(pixels, kWidth, kHeight, channels, ".png"));
    EXPECT_EQ(read_png(folder / "p.png").values, pixels);
  }
}

TEST(PictureFile, SamePicturesMakeTheSameBytesLater) {
  const TemporaryFolder folder;
  const auto bytes = [&](const std::string& extension) {
    const std::vector<FloatPicture> pictures = float_pictures(false);
    const std::size_t count = extension == ".tif" ? 1 : pictures.size();
    write_float_pictures(std::span(pictures).first(count), folder / "p", extension);
    return read_whole_file(folder / "p");
  };
  const std::string exr = bytes(".exr"), tiff = bytes(".tif");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // times in files are of whole seconds
  EXPECT_EQ(bytes(".exr"), exr);
  EXPECT_EQ(bytes(".tif"), tiff);
}

/// Overwrites, cuts or inserts bytes, mostly in the headers.
std::string damaged(std::string bytes, std::mt19937& random) {
  const std::size_t at =
      random() % (random() % 4 == 0 ? bytes.size() : std::min<std::size_t>(1000, bytes.size()));
  const auto number = static_cast<std::uint32_t>(random() % 2 == 0 ? random() : 1UL << random() % 32);
  switch (random() % 4) {
    case 0:
      bytes[at] = static_cast<char>(random());
      break;
    case 1:
      bytes.replace(at, sizeof number, bytes_of(number));
      break;
    case 2:
      bytes.erase(at, 1 + random() % 1000);
      break;
    default:
      bytes.insert(at, bytes, 1 + random() % 100, 20);
  }
  return bytes;
}

TEST(PictureFile, SmallFormatsReadOrRefuseDamagedExr) {
  const TemporaryFolder folder;
  const std::string whole = small_picture_formats().bytes_of(float_pictures(false), ".exr");
  std::mt19937 random(5);
  int refused = 0;
  for (int i = 0; i < 1000; ++i) {
    write_bytes(folder / "p.exr", damaged(whole, random));
    try {
      small_picture_formats().read_exr((folder / "p.exr").string(),
                                       [&](std::span<const FloatPicture> pictures) {
                                         for (const FloatPicture& picture : pictures)
                                           if (std::int64_t{picture.width} * picture.height > 1'000'000)
                                             throw std::runtime_error("claims");
                                       });
    } catch (const std::exception&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 300);
}

}  // namespace
}  // namespace xraycast::picture_file_test
