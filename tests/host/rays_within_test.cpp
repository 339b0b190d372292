#include "xraycast/requests/rays_within.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::rays_within_test {
namespace {

// Square roots of products of lengths up to 1500 mm in double precision.
constexpr double kRounding = 1e-9;

MapGeometry map() {
  MapGeometry geometry;
  geometry.height = 100;
  geometry.radii_mm = {0, 50};
  geometry.centre_mm = {{10, 20}};
  geometry.top_mm = 49.5;
  return geometry;
}

double length_mm(const std::optional<RaySegment>& ray) {
  return ray ? glm::distance(ray->start_mm, ray->end_mm) : 0;
}

TEST(RaysWithin, CylinderAreItsChords) {
  const View view{.lao_rad = 0.7, .centre_mm = {10, 20, 0}, .width = 121, .height = 121, .pixel_mm = 1};
  const auto rays = rays_within(view, map());
  ASSERT_EQ(rays.size(), 121u * 121u);
  for (int i = 0; i < 121; ++i) {
    const double offset = i - 60;
    EXPECT_NEAR(length_mm(rays[60 * 121 + i]),
                std::abs(offset) < 50 ? 2 * std::sqrt(2500 - offset * offset) : 0, kRounding);
  }
  // 50 mm above and below the middle it ends.
  EXPECT_EQ(length_mm(rays[9 * 121 + 60]), 0);
  EXPECT_GT(length_mm(rays[11 * 121 + 60]), 0);
}

TEST(RaysWithin, TiltedCylinderAreLongerUntilTheyLeaveThroughAnEnd) {
  View view{.cranial_rad = 0.3, .centre_mm = {10, 20, 0}, .width = 1, .height = 1, .pixel_mm = 1};
  EXPECT_NEAR(length_mm(rays_within(view, map())[0]), 100 / std::cos(0.3), kRounding);
  view.cranial_rad = 1.2;  // leaves 50 mm above and below
  EXPECT_NEAR(length_mm(rays_within(view, map())[0]), 100 / std::sin(1.2), kRounding);
}

TEST(RaysWithin, RunTowardsTheDetector) {
  const View view{.cone = Cone{500, 800}, .centre_mm = {10, 20, 0}, .width = 1, .height = 1, .pixel_mm = 1};
  const auto ray = rays_within(view, map())[0];
  ASSERT_TRUE(ray.has_value());
  EXPECT_NEAR(glm::distance(ray->start_mm, glm::dvec3(10, 70, 0)), 0, kRounding);
  EXPECT_NEAR(glm::distance(ray->end_mm, glm::dvec3(10, -30, 0)), 0, kRounding);
}

TEST(RaysWithin, SphereAreItsChords) {
  MapGeometry sphere = map();
  sphere.ray_layout = RayLayout::sphere;
  sphere.centre_z_mm = 5;
  const View view{.cranial_rad = 0.5, .centre_mm = {10, 20, 5}, .width = 61, .height = 1, .pixel_mm = 1};
  EXPECT_NEAR(length_mm(rays_within(view, sphere)[0]), 2 * std::sqrt(2500 - 900), kRounding);
}

TEST(RaysWithin, BentAxisIsRefused) {
  MapGeometry bent = map();
  bent.centre_mm.assign(100, {10, 20});
  EXPECT_THROW(rays_within(View{}, bent), InputError);
}

}  // namespace
}  // namespace xraycast::rays_within_test
