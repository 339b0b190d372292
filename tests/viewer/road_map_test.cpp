#include "xraycast/scene/road_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace xraycast::road_map_test {
namespace {

TEST(RoadMap, IsTheBorderOfWhatAbsorbs) {
  // A block of 4 x 3 in a picture of 8 x 6, and a vessel that leaves the picture.
  std::vector<float> tau(48, 0.0f);
  for (int y = 2; y < 5; ++y)
    for (int x = 1; x < 5; ++x) tau[static_cast<std::size_t>(8 * y + x)] = 0.1f;
  tau[7] = 0.1f;
  const auto outline = outline_of(tau, 8, 6);
  EXPECT_EQ(outline.size(), 10u + 1u) << "all but the two in the middle, and the corner";
  EXPECT_EQ(std::ranges::count(outline, glm::ivec2(2, 3)), 0);
  EXPECT_EQ(std::ranges::count(outline, glm::ivec2(7, 0)), 1);

  std::vector<std::uint8_t> rgb(3 * 48, 9);
  draw_outline(outline, {1, 2, 3}, 8, rgb);
  EXPECT_EQ(rgb[3 * 7 + 1], 2);
  EXPECT_EQ(rgb[3 * (8 * 3 + 2)], 9);
}

}  // namespace
}  // namespace xraycast::road_map_test
