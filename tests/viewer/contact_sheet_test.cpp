#include "xraycast/reports/contact_sheet.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

namespace xraycast::contact_sheet_test {
namespace {

int grey_at(const RgbPicture& sheet, int x, int y) {
  return sheet.rgb[3 * (static_cast<std::size_t>(y) * sheet.width + x)];
}

TEST(ContactSheet, FitsAPictureIntoTheMiddleOfItsCellAndKeepsItsMean) {
  const TemporaryFolder folder;
  constexpr int kWidth = 1600, kHeight = 800;
  std::vector<std::uint8_t> board;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) board.push_back((x + y) % 2 == 0 ? 0 : 200);
  write_picture(board, kWidth, kHeight, 1, folder / "board.png");
  const RgbPicture sheet = contact_sheet({{folder / "board.png", "a board"}}, 1);
  const int middle = sheet.width / 2;
  const int paper = grey_at(sheet, middle, 2);
  // Where the picture begins and ends: half as high as it is wide, the cell being higher than wide.
  int first = 0, last = 0;
  const int centre = sheet.height / 2 - 20;
  while (grey_at(sheet, middle, first) == paper) ++first;
  last = centre;
  while (grey_at(sheet, middle, last) != paper) ++last;
  EXPECT_EQ(last - first, 200);
  // The mean of black and 200, but for the filter's rounding and its few samples.
  for (int y = first + 2; y < last - 2; ++y)
    ASSERT_THAT(grey_at(sheet, middle, y), testing::AllOf(testing::Ge(90), testing::Le(110))) << y;
}

TEST(ContactSheet, ScalesThePicturesOfARowToOneHeightAndFillsItsWidth) {
  const TemporaryFolder folder;
  std::vector<CaptionedPicture> pictures;
  for (const auto& [width, height] : {std::pair{200, 100}, {90, 120}, {300, 400}, {50, 100}, {640, 480}}) {
    const auto file = folder / fmt::format("{}.png", width);
    write_picture(std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height, 255), width, height, 1,
                  file);
    pictures.push_back({file, ""});
  }
  // In two rows, of three and of two: 2 + 0.75 + 0.75 times as wide as high, and 0.5 + 1.33 times.
  const RgbPicture sheet = contact_sheet(pictures, 4);
  const auto white_at = [&](int y) {
    int white = 0, last = 0;
    for (int x = 0; x < sheet.width; ++x)
      if (grey_at(sheet, x, y) == 255) ++white, last = x;
    return std::pair(white, last);
  };
  const double first_row = (sheet.width - 4 * 12) / 3.5;
  EXPECT_NEAR(white_at(20).first, sheet.width - 4 * 12, 6);
  EXPECT_NEAR(white_at(20).second, sheet.width - 12, 6);
  EXPECT_NEAR(white_at(static_cast<int>(first_row)).first, sheet.width - 4 * 12, 6);
  // The second one is as high as a row may be, and spreads the room that is left around its pictures.
  const auto [white, last] = white_at(static_cast<int>(first_row) + 100);
  const double widths = 520 * (0.5 + 4.0 / 3), left = sheet.width - 3 * 12 - widths;
  EXPECT_NEAR(white, widths, 4);
  EXPECT_NEAR(last, sheet.width - 12 - left / 4, 4);
}

TEST(ContactSheet, NamesAPictureThatCannotBeRead) {
  const TemporaryFolder folder;
  try {
    contact_sheet({{folder / "none.png", "nothing"}}, 1);
    FAIL() << "made";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::StartsWith((folder / "none.png").string() + ": could not be read: "));
  }
}

}  // namespace
}  // namespace xraycast::contact_sheet_test
