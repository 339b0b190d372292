#include "xraycast/projection/view.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace xraycast::view_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
// Rounding of sines, cosines and products of lengths up to 2000 mm in double precision.
constexpr double kRounding = 1e-9;

void expect_near(const glm::dvec3& actual, const glm::dvec3& expected) {
  EXPECT_NEAR(actual.x, expected.x, kRounding);
  EXPECT_NEAR(actual.y, expected.y, kRounding);
  EXPECT_NEAR(actual.z, expected.z, kRounding);
}

TEST(View, FrontalPictureShowsThePatientsLeftOnTheRight) {
  const View view{};
  expect_near(view.towards_detector(), {0, -1, 0});
  expect_near(view.right(), {1, 0, 0});
  expect_near(view.up(), {0, 0, 1});
}

TEST(View, LeftLateralDetectorStandsAtThePatientsLeft) {
  const View view{.lao_rad = 90 * kRadians};
  expect_near(view.towards_detector(), {1, 0, 0});
  expect_near(view.right(), {0, 1, 0});
}

TEST(View, CranialTiltMovesTheDetectorTowardsTheHead) {
  const View view{.lao_rad = 0, .cranial_rad = 30 * kRadians};
  EXPECT_GT(view.towards_detector().z, 0);
  EXPECT_NEAR(glm::dot(view.towards_detector(), view.up()), 0, kRounding);
  EXPECT_NEAR(glm::length(view.up()), 1, kRounding);
}

TEST(View, PixelsLieAsDocumented) {
  View view{.lao_rad = 30 * kRadians, .centre_mm = {10, 20, 30}, .width = 4, .height = 3, .pixel_mm = 2};
  expect_near(view.pixel_on_detector_mm(1.5, 1), view.centre_mm);
  expect_near(view.pixel_on_detector_mm(0, 0), view.centre_mm - 3.0 * view.right() + 2.0 * view.up());
  view.cone = Cone{1000, 1500};
  expect_near(view.pixel_on_detector_mm(1.5, 1), view.centre_mm + 500.0 * view.towards_detector());
  expect_near(view.source_mm(), view.centre_mm - 1000.0 * view.towards_detector());
}

TEST(ViewLabel, SpeaksAsTheRoomDoes) {
  EXPECT_EQ(label(View{}), "AP");
  EXPECT_EQ(label(View{.lao_rad = 30 * kRadians, .cranial_rad = 10 * kRadians}), "LAO 30 / CRA 10");
  EXPECT_EQ(label(View{.lao_rad = -45 * kRadians, .cranial_rad = -12.5 * kRadians}), "RAO 45 / CAU 12.5");
  EXPECT_EQ(label(View{.lao_rad = 330 * kRadians}), "RAO 30");
}

class FittedView : public testing::TestWithParam<View> {};

TEST_P(FittedView, ShowsTheWholeBody) {
  const VolumeGeometry volume{{512, 512, 300}, {0.8, 0.8, 1}, {-204.4, -204.4, 0}};
  const BodyOutline body{{5, -3}, 150};
  View view = GetParam();
  view.centre_mm = {5, -3, 149.5};
  view.pixel_mm = 0;
  view = fitted(view, volume, body);
  for (const double z : {-0.5, 299.5}) {
    for (int degree = 0; degree < 360; degree += 15) {
      const double phi = degree * kRadians;
      const glm::dvec3 rim = glm::dvec3(5, -3, z) + 150.0 * glm::dvec3(std::sin(phi), -std::cos(phi), 0);
      glm::dvec3 offset = rim - view.centre_mm;
      if (view.cone)
        offset *= view.cone->source_detector_mm /
                  (view.cone->source_axis_mm + glm::dot(offset, view.towards_detector()));
      EXPECT_LE(std::abs(glm::dot(offset, view.right())), 0.5 * view.width * view.pixel_mm + kRounding);
      EXPECT_LE(std::abs(glm::dot(offset, view.up())), 0.5 * view.height * view.pixel_mm + kRounding);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(View, FittedView,
                         testing::Values(View{}, View{.lao_rad = 1}, View{.lao_rad = 1, .cranial_rad = 0.5},
                                         View{.lao_rad = 1, .cone = Cone{1000, 1500}},
                                         View{.lao_rad = 2, .cranial_rad = -0.5, .cone = Cone{800, 1200}},
                                         View{.width = 640, .height = 480}));

TEST(FittedView, HasNoPixelForARoundingError) {
  // Between its faces this scan is 170.00000000000003 slices high.
  const double pixel_mm = 0.9570312;
  const VolumeGeometry volume{{1, 1, 170}, {pixel_mm, pixel_mm, pixel_mm}, {0, 0, -9.9}};
  ASSERT_GT((volume.upper_mm().z - volume.lower_mm().z) / pixel_mm, 170);
  const View view = fitted(View{}, volume, {{0, 0}, 100 * pixel_mm});
  EXPECT_EQ(view.height, 170);
  EXPECT_EQ(view.width, 200);
}

TEST(FittedView, RefusesWhatCannotBeDrawn) {
  const VolumeGeometry volume{{10, 10, 10}, {1, 1, 1}, {0, 0, 0}};
  const BodyOutline body{{5, 5}, 5};
  EXPECT_THROW(fitted(View{.cone = Cone{0, 1500}}, volume, body), InputError);
  EXPECT_THROW(fitted(View{.cone = Cone{1e-308, 1500}}, volume, body), InputError);
  EXPECT_THROW(fitted(View{.cone = Cone{1000, 1e9}}, volume, body), InputError);
  EXPECT_THROW(fitted(View{.cone = Cone{1000, 900}}, volume, body), InputError);
  EXPECT_THROW(fitted(View{.width = 100000}, volume, body), InputError);
  EXPECT_THROW(fitted(View{.lao_rad = std::nan("")}, volume, body), InputError);
}

}  // namespace
}  // namespace xraycast::view_test
