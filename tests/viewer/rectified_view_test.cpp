#include "xraycast/sampling/rectified_view.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

namespace xraycast::rectified_view_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

MapGeometry map() {
  MapGeometry geometry;
  geometry.height = 200;
  geometry.radii_mm = {0, 60, 120};
  geometry.centre_mm = {{12, -7}};
  geometry.top_mm = 150;
  geometry.row_spacing_mm = 1.5;
  return geometry;
}

View view_at(double angle_deg, double tilt_deg, std::optional<Cone> cone) {
  return fitted(View{.lao_rad = angle_deg * kRadians,
                     .cranial_rad = tilt_deg * kRadians,
                     .cone = cone,
                     .centre_mm = {10, -5, 20},
                     .width = 200,
                     .height = 160},
                bounds_of(map()));
}

/// The column and row of a pixel's ray.
glm::dvec2 place_of_pixel(const RectifiedView& rectified, double i, double j) {
  const glm::dvec3 place = rectified.from_pixel * glm::dvec3(i + 0.5, j + 0.5, 1);
  return glm::dvec2(place) / place.z;
}

/// Why a view cannot be drawn; empty where it can.
std::string refusal_of(const View& view) {
  try {
    rectified_view(view, map());
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// Rise over run of a column's ray that crosses the plane at a height.
double slope_at(const RectifiedView& rectified, double column, double z_mm) {
  if (!rectified.is_cone()) return rectified.slope;
  return (z_mm - rectified.source_z_mm) / std::hypot(rectified.source_mm, rectified.column_x_mm(column));
}

class RectifiedViews : public testing::TestWithParam<View> {};

TEST_P(RectifiedViews, FollowTheSameRays) {
  const View& view = GetParam();
  const RectifiedView rectified = rectified_view(view, map());
  for (const double i : {0.0, 50.5, 99.5, 199.0})
    for (const double j : {0.0, 30.0, 79.5, 159.0}) {
      const glm::dvec3 pixel = view.pixel_on_detector_mm(i, j);
      const glm::dvec3 along = view.cone ? glm::normalize(pixel - view.source_mm()) : view.towards_detector();
      const glm::dvec2 place = place_of_pixel(rectified, i, j);
      const double z = rectified.top_mm - place.y * rectified.row_mm;
      for (const double s : {-100.0, 0.0, 80.0}) {
        const glm::dvec2 xy = rectified.origin_mm(place.x) + s * rectified.direction(place.x);
        const glm::dvec3 point(xy, z + s * slope_at(rectified, place.x, z));
        // Products of lengths up to 2000 mm in double precision.
        EXPECT_LT(glm::length(glm::cross(point - pixel, along)), 1e-8) << i << ' ' << j << ' ' << s;
      }
    }
}

TEST_P(RectifiedViews, HoldAllOfTheBodyThatIsSeen) {
  const View& view = GetParam();
  const MapGeometry geometry = map();
  const RectifiedView rectified = rectified_view(view, geometry);
  for (int i = 0; i < view.width; i += 3)
    for (int j = 0; j < view.height; j += 3) {
      const glm::dvec3 pixel = view.pixel_on_detector_mm(i, j);
      const glm::dvec3 along = view.cone ? glm::normalize(pixel - view.source_mm()) : view.towards_detector();
      bool meets = false;
      for (double t = -3000; t < 3000 && !meets; t += 1) {
        const glm::dvec3 p = pixel + t * along;
        meets = glm::distance(glm::dvec2(p), geometry.centre_mm[0]) < 120 && p.z < geometry.z_mm(0) &&
                p.z > geometry.z_mm(geometry.height - 1);
      }
      if (!meets) continue;
      const glm::dvec2 place = place_of_pixel(rectified, i, j);
      EXPECT_GE(place.x, -1e-9);
      EXPECT_LE(place.x, rectified.columns - 1 + 1e-9);
      EXPECT_GE(place.y, -1e-9);
      EXPECT_LE(place.y, rectified.rows - 1 + 1e-9) << i << ' ' << j;
    }
}

INSTANTIATE_TEST_SUITE_P(Views, RectifiedViews,
                         testing::Values(view_at(0, 0, {}), view_at(130, 0, {}), view_at(-35, 20, {}),
                                         view_at(0, 0, Cone{1000, 1500}), view_at(70, -25, Cone{700, 1200})));

TEST(RectifiedView, OfAnUntiltedParallelBeamHasTheMapsRowsAndThePixelsColumns) {
  const RectifiedView rectified = rectified_view(view_at(30, 0, {}), map());
  EXPECT_EQ(rectified.row_mm, 1.5);
  // The first row is one of the map's, every fourth of which begins a texel.
  EXPECT_EQ(std::remainder((150 - rectified.top_mm) / 1.5, 4), 0);
  const glm::dvec2 place = place_of_pixel(rectified, 100, 80);
  EXPECT_NEAR(place.x, std::round(place.x), 1e-9);
}

/// A view of so many columns that shows all of the body.
View wide_view(int columns, double tilt_deg, std::optional<Cone> cone) {
  View view{.cranial_rad = tilt_deg * kRadians,
            .cone = cone,
            .centre_mm = {10, -5, 20},
            .width = columns,
            .height = columns,
            .pixel_mm = 400.0 / columns};
  return fitted(view, bounds_of(map()));
}

TEST(RectifiedView, HasTwoColumnsToAPixelUnderAConeOrATilt) {
  const auto columns_per_pixel = [](double tilt_deg, std::optional<Cone> cone) {
    const RectifiedView rectified = rectified_view(wide_view(200, tilt_deg, cone), map());
    return place_of_pixel(rectified, 100.5, 99.5).x - place_of_pixel(rectified, 99.5, 99.5).x;
  };
  // A perspective changes the distance between columns by less than a hundredth over a pixel.
  EXPECT_NEAR(columns_per_pixel(0, {}), 1, 1e-9);
  EXPECT_NEAR(columns_per_pixel(20, {}), 2, 1e-9);
  EXPECT_NEAR(columns_per_pixel(0, Cone{1000, 1500}), 2, 0.02);
  EXPECT_NEAR(columns_per_pixel(20, Cone{1000, 1500}), 2, 0.02);
}

TEST(RectifiedView, OfALargePictureStaysWithinWhatOpenGlDrawsInto) {
  constexpr int kLargestTarget = 16384;
  for (const double tilt_deg : {0.0, 20.0})
    for (const int width : {8000, 10000, 14000}) {
      const RectifiedView rectified = rectified_view(wide_view(width, tilt_deg, Cone{1000, 1500}), map());
      EXPECT_GT(rectified.columns, width / 2) << width;
      EXPECT_LE(rectified.columns, kLargestTarget) << width;
      EXPECT_LE(rectified.rows, 4 * kLargestTarget) << width;
    }
  EXPECT_GT(rectified_view(wide_view(8000, 0, Cone{1000, 1500}), map()).columns, 8000);
}

TEST(RectifiedView, RefusesToLookAlongTheAxis) {
  EXPECT_EQ(refusal_of(view_at(0, 85, {})),
            "a tilt of 85 deg looks along the map's axis; rays must be at least 10 deg from it");
}

TEST(RectifiedView, SaysWhetherTiltOrConeIsToBlameForRaysAlongTheAxis) {
  View view = view_at(0, 0, Cone{100, 200});
  view.width = 640;
  view.height = 480;
  view.pixel_mm = 5;  // half a diagonal is 2 m
  EXPECT_EQ(refusal_of(view),
            "a picture of 3200 x 2400 mm is too large for a detector 200 mm from the source: rays to its "
            "corners are 84.3 deg from the one to its middle, and must be within 80 deg; place source and "
            "detector farther from the body, or make the picture smaller");
  view.pixel_mm = 0.5;  // 200 mm: half a right angle
  EXPECT_EQ(refusal_of(view), "");
  view.cranial_rad = 50 * kRadians;
  EXPECT_EQ(refusal_of(view),
            "a tilt of 50 deg looks along the map's axis in the picture's corners, whose rays are 45.0 deg "
            "from the one to its middle; rays must be at least 10 deg from it");
}

}  // namespace
}  // namespace xraycast::rectified_view_test
