// What is worked on four at once against one by one.

// Functions on four numbers are inlined, so that it does not matter how these are passed.
#pragma GCC diagnostic ignored "-Wpsabi"

#include "xraycast/mechanics/rod_frames.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <random>

namespace xraycast::rod_frames_test {
namespace {

TEST(RodFrames, SinesAndAnglesOfFourAreThoseOfTheLibrary) {
  std::mt19937 random(5);
  // Within and beyond the reach of the series, and both among one four.
  for (const double largest_rad : {1e-6, 0.01, 0.2, 0.3, 0.49, 0.6, 3.1}) {
    std::uniform_real_distribution<double> angle(-largest_rad, largest_rad);
    for (int i = 0; i < 1000; ++i) {
      const Lanes angles{angle(random), 0, -largest_rad, angle(random) / 100};
      const Turn<Lanes> turns = turn_by(angles);
      const Lanes back = angle_of(turns.sine, turns.cosine);
      for (std::size_t k = 0; k < kLanes; ++k) {
        const Turn<double> turn = turn_by(angles[k]);
        // Two units in the last digit of one.
        EXPECT_NEAR(turns.cosine[k], turn.cosine, 5e-16);
        EXPECT_NEAR(turns.sine[k], turn.sine, 5e-16);
        // The same of the angle, which has twice the error of its half's tangent.
        EXPECT_NEAR(back[k], angles[k], 1e-15 * (1 + largest_rad));
      }
    }
  }
}

TEST(RodFrames, WholeNumbersOfFourAreTheNearest) {
  const Lanes whole_of = whole(Lanes{0.49, -0.51, 3.2, -7.9});
  EXPECT_EQ(whole_of[0], 0);
  EXPECT_EQ(whole_of[1], -1);
  EXPECT_EQ(whole_of[2], 3);
  EXPECT_EQ(whole_of[3], -8);
}

}  // namespace
}  // namespace xraycast::rod_frames_test
