#include "xraycast/casting/outline_bands.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

namespace xraycast {
namespace {

MapGeometry of_rows(const std::vector<float>& radii_mm) {
  MapGeometry geometry =
      cylinder_map({{64, 64, static_cast<std::int64_t>(radii_mm.size())}, {1, 1, 1}, {0, 0, 0}}, 8,
                   {0, 10, 20}, glm::dvec2(30));
  std::vector<float> outline_mm;
  for (const float radius_mm : radii_mm) outline_mm.insert(outline_mm.end(), 8, radius_mm);
  return with_outline(geometry, std::move(outline_mm));
}

TEST(OutlineBands, AreRunsOfRowsThatShareAnOutline) {
  EXPECT_EQ(outline_bands(of_rows({20, 20, 12, 20, 20, 20})),
            (std::vector<OutlineBand>{{0, 2}, {2, 1}, {3, 3}}));
  EXPECT_EQ(outline_bands(of_rows({20, 20, 20})), (std::vector<OutlineBand>{{0, 3}}));
}

TEST(OutlineBands, OfOneOutlineOrOfCirclesAreOne) {
  MapGeometry geometry = of_rows({20, 20, 20, 20});
  geometry.outline_mm.resize(8);
  EXPECT_EQ(outline_bands(geometry), (std::vector<OutlineBand>{{0, 4}}));
  geometry.outline_mm.clear();
  EXPECT_EQ(outline_bands(geometry), (std::vector<OutlineBand>{{0, 4}}));
}

}  // namespace
}  // namespace xraycast
