#include "xraycast/base/picture_file.hpp"

#include "support/pictures.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <sstream>
#include <sys/resource.h>
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
      const RgbPicture read = read_picture(folder / ("p" + extension));
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
  EXPECT_THROW(write_picture(smooth_picture(1), kWidth, kHeight, 1, folder / "p.xyz"), Error);
  EXPECT_TRUE(is_picture_name("p.JPG"));
}

TEST(PictureFile, ThatCannotBeReadIsNamed) {
  const TemporaryFolder folder;
  write_whole_file(folder / "text.png", "no picture");
  for (const char* name : {"none.png", "text.png", "none.jpg"}) try {
      read_picture(folder / name);
      FAIL() << "read";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), testing::StartsWith((folder / name).string() + ": could not be read: "));
      EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
    }
}

TEST(PictureFile, SamePicturesMakeTheSameBytesLater) {
  const TemporaryFolder folder;
  const auto files = [&] {
    std::vector<std::string> contents;
    for (const std::string& extension : offered_extensions()) {
      write_picture(smooth_picture(3), kWidth, kHeight, 3, folder / ("p" + extension));
      contents.push_back(read_whole_file(folder / ("p" + extension)));
    }
    write_tiff(std::vector<float>(6, 0.5f), 3, 2, "tau", folder / "floats.tif");
    contents.push_back(read_whole_file(folder / "floats.tif"));
    return contents;
  };
  const std::vector<std::string> first = files();
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // times in files are of whole seconds
  EXPECT_EQ(files(), first);
}

TEST(PictureFile, OfPngMakesTheSameBytesInMemory) {
  const TemporaryFolder folder;
  for (const int channels : {1, 3}) {
    const std::vector<std::uint8_t> pixels = smooth_picture(channels);
    write_picture(pixels, kWidth, kHeight, channels, folder / "p.png");
    EXPECT_EQ(read_png(folder / "p.png").values, pixels);
    EXPECT_EQ(png_bytes(pixels, kWidth, kHeight, channels), read_whole_file(folder / "p.png"));
  }
}

TEST(PictureFile, OfPngHasTheSameGreysAsOfOtherFormats) {
  const TemporaryFolder folder;
  for (const int channels : {1, 3}) {
    for (const char* name : {"p.png", "p.tif"})
      write_picture(smooth_picture(channels), kWidth, kHeight, channels, folder / name);
    const FloatPicture png = read_grey_picture(folder / "p.png"), tiff = read_grey_picture(folder / "p.tif");
    EXPECT_EQ(png.width, kWidth);
    EXPECT_EQ(png.height, kHeight);
    EXPECT_FALSE(png.has_next);
    // OpenImageIO's mean is one of shares of the largest.
    EXPECT_THAT(png.grey, testing::Pointwise(testing::FloatNear(1e-3F), tiff.grey));
  }
}

/// What is said of a file that read_grey_picture refuses as an input.
std::string refusal_of(const std::filesystem::path& path, int page = 0) {
  try {
    read_grey_picture(path, page);
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << path << " was read";
  return "";
}

TEST(PictureFile, OfPngThatIsDamagedIsRefusedWithoutAWordOfTheLibrarys) {
  const TemporaryFolder folder;
  const std::string whole = png_bytes(smooth_picture(1), kWidth, kHeight, 1);
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 0x10;
  for (const std::string& bytes : {flipped, whole.substr(0, whole.size() / 2), whole.substr(0, 4)}) {
    write_whole_file(folder / "p.png", bytes);
    testing::internal::CaptureStderr();
    EXPECT_THAT(refusal_of(folder / "p.png"),
                testing::StartsWith((folder / "p.png").string() + ": could not be read: "));
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  }
}

TEST(PictureFile, HasAtMost8192PixelsAlongASide) {
  const TemporaryFolder folder;
  for (const char* name : {"p.png", "p.tif"})
    for (const bool is_wide : {true, false})
      for (const int most : {8192, 8193}) {
        const auto file = folder / name;
        write_picture(std::vector<std::uint8_t>(static_cast<std::size_t>(most), 7), is_wide ? most : 1,
                      is_wide ? 1 : most, 1, file);
        if (most == 8192)
          EXPECT_EQ(read_grey_picture(file).grey.size(), 8192U) << name;
        else
          EXPECT_THAT(refusal_of(file), testing::EndsWith(": could not be read: it has more than 8192 pixels "
                                                          "along a side; make it smaller"));
      }
}

TEST(PictureFile, HasThePagesThatItHas) {
  const TemporaryFolder folder;
  for (const char* name : {"p.png", "p.tif"}) {
    write_picture(smooth_picture(1), kWidth, kHeight, 1, folder / name);
    EXPECT_FALSE(read_grey_picture(folder / name, 0).has_next);
    EXPECT_THAT(refusal_of(folder / name, 1), testing::HasSubstr("it has no page 2; name one that it has"));
    EXPECT_THAT(refusal_of(folder / name, -1), testing::HasSubstr("it has no page 0; name one that it has"));
  }
}

TEST(PictureFile, ThatIsNoneIsRefusedAsAnyFile) {
  const TemporaryFolder folder;
  EXPECT_THAT(refusal_of(folder / "none.png"), testing::HasSubstr("no such file"));
  EXPECT_THAT(refusal_of(folder.path()), testing::HasSubstr("a folder"));
  write_whole_file(folder / "p.png", png_bytes(smooth_picture(1), kWidth, kHeight, 1));
  std::filesystem::permissions(folder / "p.png", std::filesystem::perms::none);
  if (!std::ifstream(folder / "p.png")) {  // root reads it all the same
    EXPECT_THAT(refusal_of(folder / "p.png"), testing::HasSubstr("check its permissions"));
  }
}

#ifndef __SANITIZE_ADDRESS__  // whose shadow memory is beyond any limit
TEST(PictureFile, IsNotToBlameForALackOfMemory) {
  constexpr int kWide = 8192, kHigh = 4096;  // 64 MB as a PNG's bytes, 134 MB as floats
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> black(std::size_t{kWide} * kHigh);
  for (const char* name : {"p.png", "p.tif"}) {
    write_picture(black, kWide, kHigh, 1, folder / name);
    rlimit before{};
    getrlimit(RLIMIT_AS, &before);
    const rlimit limit{static_cast<rlim_t>(address_space_taken_B()) + (100 << 20), before.rlim_max};
    setrlimit(RLIMIT_AS, &limit);
    try {
      read_grey_picture(folder / name);
      ADD_FAILURE() << name << " was read";
    } catch (const InputError& error) {
      ADD_FAILURE() << error.what();
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), testing::AllOf(testing::StartsWith((folder / name).string() + ": "),
                                               testing::HasSubstr("memory")));
    }
    setrlimit(RLIMIT_AS, &before);
  }
}
#endif

}  // namespace
}  // namespace xraycast::picture_file_test
