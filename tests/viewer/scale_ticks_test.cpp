#include "xraycast/reports/scale_ticks.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::scale_ticks_test {
namespace {

using testing::ElementsAre;

TEST(ScaleTicks, AreRoundAndAsFarApartAsIsAskedFor) {
  EXPECT_THAT(scale_ticks(-120, 90, 32.5), ElementsAre(-100, -50, 0, 50));
  EXPECT_THAT(scale_ticks(0, 100, 20), ElementsAre(0, 20, 40, 60, 80, 100));
  EXPECT_THAT(scale_ticks(811, 1500, 260), ElementsAre(1000, 1500));
}

TEST(ScaleTicks, AreAtLeastTwo) {
  EXPECT_THAT(scale_ticks(3, 60, 32.5), ElementsAre(20, 60));
  EXPECT_THAT(scale_ticks(-3, 3, 100), ElementsAre(-2, 2));
  EXPECT_THAT(scale_ticks(101.5, 104.5, 32.5), ElementsAre(102, 104));
  EXPECT_THAT(scale_ticks(0.2, 0.3, 5), testing::SizeIs(2));
  EXPECT_THAT(scale_ticks(7.25, 7.25, 5), ElementsAre(7.25));
}

TEST(ScaleTicks, HaveNoNegativeZero) {
  for (const double low : {-0.5, -1.0, -40.0})
    for (const double tick : scale_ticks(low, 40, 10))
      EXPECT_FALSE(tick == 0 && std::signbit(tick)) << fmt::format("{:g} from {}", tick, low);
}

}  // namespace
}  // namespace xraycast::scale_ticks_test
