#include "xraycast/coaxial/rod_curve.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace xraycast::rod_curve_test {
namespace {

using Eigen::Vector3d;

TEST(RodCurve, PlacesOfManyPointsAreThoseOfEachAlone) {
  // A rod in a bow of 30 mm; points beside it, before its clamp and beyond its tip, and starts some segments
  // away.
  RodState rod;
  for (int i = 0; i <= 40; ++i) {
    const double angle = 0.05 * i;
    rod.nodes_mm.emplace_back(30 * std::cos(angle), 30 * std::sin(angle), 0.1 * i);
  }
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<NearestPlace> searches;
  for (int i = 0; i < 203; ++i) {
    const double angle = 1 + 1.1 * unit(random);
    const auto start = static_cast<std::size_t>(std::clamp(20 * angle + 4 * unit(random), 0.0, 40.0));
    searches.push_back({.point_mm = Vector3d(30 * std::cos(angle), 30 * std::sin(angle), 2 * angle) +
                                    0.5 * Vector3d(unit(random), unit(random), unit(random)),
                        .place = {start, 0.5}});
  }
  std::vector<NearestPlace> together = searches;
  find_nearest_places(rod, together);
  for (std::size_t k = 0; k < searches.size(); ++k) {
    const RodPlace alone = nearest_place(rod, searches[k].place, searches[k].point_mm);
    EXPECT_EQ(together[k].place.segment, alone.segment) << k;
    EXPECT_EQ(together[k].place.t, alone.t) << k;
    const RodWeights weights = RodWeights::at(alone, rod.nodes_mm.size());
    // The way to the point, normal to the curve: rounding of 30 mm, and the square of the search's tolerance.
    EXPECT_LT((together[k].offset_mm - (searches[k].point_mm - weights.position_mm(rod))).norm(), 1e-12) << k;
    EXPECT_NEAR(together[k].offset_mm.dot(weights.of(weights.slope, rod)), 0, 1e-10) << k;
  }
}

}  // namespace
}  // namespace xraycast::rod_curve_test
