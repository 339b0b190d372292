#include "xraycast/reports/contact_sheet.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
