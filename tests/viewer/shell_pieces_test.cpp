#include "xraycast/sampling/shell_pieces.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::shell_pieces_test {
namespace {

// Square roots and differences of lengths up to 100 mm in double precision.
constexpr double kRounding = 1e-12;
const std::vector<double> kRadii{0, 30, 50, 100};

TEST(ShellPieces, ThroughTheAxisAreTheShellsThemselves) {
  const auto pieces = shell_pieces(kRadii, 0);
  ASSERT_EQ(pieces.size(), 6u);
  const int shells[] = {2, 1, 0, 0, 1, 2};
  const double edges[] = {-100, -50, -30, 0, 30, 50, 100};
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(pieces[i].shell, shells[i]);
    EXPECT_EQ(pieces[i].from_mm >= 0, i >= 3);
    EXPECT_NEAR(pieces[i].from_mm, edges[i], kRounding);
    EXPECT_NEAR(pieces[i].to_mm, edges[i + 1], kRounding);
  }
}

TEST(ShellPieces, AreChordsOffTheAxis) {
  // 40 mm off, circles of 50 and 100 mm are left at sqrt(50^2 - 40^2) = 30 and sqrt(100^2 - 40^2).
  const auto pieces = shell_pieces(kRadii, -40);
  ASSERT_EQ(pieces.size(), 4u);
  EXPECT_NEAR(pieces[2].to_mm, 30, kRounding);
  EXPECT_NEAR(pieces[3].to_mm, std::sqrt(8400.0), kRounding);
  EXPECT_NEAR(pieces[0].length_mm(), pieces[3].length_mm(), kRounding);
}

TEST(ShellPieces, JoinWithoutGapsAndAddUpToTheChord) {
  for (const double offset : {0.0, 1e-9, 29.999999, 30.0, 49.0, 99.9999999}) {
    const auto pieces = shell_pieces(kRadii, offset);
    double sum = 0;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      sum += pieces[i].length_mm();
      EXPECT_NEAR(pieces[i].from_mm, i > 0 ? pieces[i - 1].to_mm : pieces[i].from_mm, kRounding) << offset;
    }
    EXPECT_NEAR(sum, 2 * std::sqrt((100 - offset) * (100 + offset)), kRounding) << offset;
  }
}

TEST(ShellPieces, LeaveOutAHoleAndWhatTheyMiss) {
  EXPECT_THAT(shell_pieces(kRadii, 100), ::testing::IsEmpty());
  EXPECT_THAT(shell_pieces(kRadii, 250), ::testing::IsEmpty());
  const auto pieces = shell_pieces(std::vector<double>{30, 50}, 0);
  ASSERT_EQ(pieces.size(), 2u);
  EXPECT_EQ(pieces[0].to_mm, -30);
  EXPECT_EQ(pieces[1].from_mm, 30);
}

}  // namespace
}  // namespace xraycast::shell_pieces_test
