#include "xraycast/sampling/c_arm_pose.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/scene/vessels.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace xraycast::c_arm_pose_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
// A few products of doubles of up to 1000.
constexpr double kRounding = 1e-10;

const BodyBounds kBody{{10, 20, 300}, 150, 200, 1};

TEST(CArmPose, ShowsTheWholeBodyAtFirst) {
  const View view = view_of(CArmPose{}, kBody, 640, 480);
  EXPECT_EQ(view.centre_mm, kBody.centre_mm);
  // 400 mm of height in 480 pixels; its 300 mm of width need fewer.
  EXPECT_NEAR(view.pixel_mm, 400.0 / 480, kRounding);
}

TEST(CArmPose, RotatesBothWaysAndStaysWithinAHalfTurn) {
  CArmPose pose;
  pose.rotate(30);
  EXPECT_NEAR(pose.lao_rad, 30 * kRadians, kRounding);
  pose.rotate(170);
  EXPECT_NEAR(pose.lao_rad, -160 * kRadians, kRounding);
}

TEST(CArmPose, TableTravelMovesThePictureAlongTheAxisAndStopsAtTheEnds) {
  CArmPose pose;
  pose.travel(50, kBody);
  EXPECT_NEAR(view_of(pose, kBody, 640, 480).centre_mm.z, 350, kRounding);
  pose.travel(1000, kBody);
  EXPECT_EQ(pose.table_mm, 200);
}

TEST(CArmPose, TableTravelMovesThePictureAcrossTheAxis) {
  CArmPose pose;
  pose.travel({30, -40, 50}, kBody);
  EXPECT_EQ(view_of(pose, kBody, 640, 480).centre_mm, kBody.centre_mm + glm::dvec3(30, -40, 50));
  EXPECT_NEAR(view_of(pose, kBody, 640, 480).pixel_mm, 400.0 / 480, kRounding);
  pose.travel({1000, -1000, 1000}, kBody);
  EXPECT_EQ(pose.across_mm, glm::dvec2(150, -150));
  EXPECT_EQ(pose.table_mm, 200);
}

TEST(CArmPose, ZoomMagnifiesAboutTheCentre) {
  CArmPose pose;
  const double before = view_of(pose, kBody, 640, 480).pixel_mm;
  pose.magnify(4);
  EXPECT_NEAR(view_of(pose, kBody, 640, 480).pixel_mm, before / 4, kRounding);
  pose.magnify(1e9);
  EXPECT_EQ(pose.zoom, CArmPose::kMaxZoom);
}

TEST(CArmPose, TiltKeepsTheMagnificationAndHasAnEnd) {
  CArmPose pose;
  const double before = view_of(pose, kBody, 640, 480).pixel_mm;
  pose.tilt(25);
  EXPECT_NEAR(view_of(pose, kBody, 640, 480).pixel_mm, before, kRounding);
  pose.tilt(1000);
  EXPECT_EQ(pose.cranial_rad, CArmPose::kMaxTilt_rad);
}

TEST(CArmPose, ConeEnlargesWithItsDistances) {
  CArmPose pose;
  pose.cone = Cone{1000, 1500};
  const View view = view_of(pose, kBody, 640, 480);
  ASSERT_TRUE(view.cone.has_value());
  // The rim nearest to the source is 850 mm from it, and enlarged 1500/850 times.
  EXPECT_NEAR(view.pixel_mm, 400.0 * 1500 / 850 / 480, kRounding);
}

TEST(CArmPose, StatusSpeaksAsTheRoomDoes) {
  CArmPose pose;
  EXPECT_EQ(status_of(pose), "AP   table +0 mm   x1");
  pose = {.lao_rad = 30 * kRadians, .cranial_rad = -10 * kRadians, .table_mm = -12, .zoom = 1.5};
  EXPECT_EQ(status_of(pose), "LAO 30 / CAU 10   table -12 mm   x1.5");
}

TEST(BodyBounds, EncloseTheMap) {
  MapGeometry cylinder;
  cylinder.height = 100;
  cylinder.radii_mm = {0, 90};
  cylinder.centre_mm = {{3, 4}};
  cylinder.top_mm = 50;
  cylinder.row_spacing_mm = 2;
  cylinder.step_mm = 0.7;
  const BodyBounds bounds = bounds_of(cylinder);
  EXPECT_EQ(bounds.centre_mm, glm::dvec3(3, 4, 50 - 99));
  EXPECT_EQ(bounds.half_height_mm, 100);
  EXPECT_EQ(bounds.radius_mm, 90);
  EXPECT_EQ(bounds.finest_mm, 0.7);

  MapGeometry bent = cylinder;
  bent.centre_mm.assign(100, {3, 4});
  bent.centre_mm.back() = {3, 24};
  EXPECT_EQ(bounds_of(bent).radius_mm, 100);
  EXPECT_EQ(bounds_of(bent).centre_mm.y, 14);

  MapGeometry sphere = cylinder;
  sphere.ray_layout = RayLayout::sphere;
  sphere.centre_z_mm = 7;
  EXPECT_EQ(bounds_of(sphere).centre_mm, glm::dvec3(3, 4, 7));
  EXPECT_EQ(bounds_of(sphere).half_height_mm, 90);
}

TEST(BodyBounds, NoticeVesselsOfAnotherScan) {
  // Beside the body, above it, and two within.
  const std::vector<glm::vec3> points{{170, 20, 300}, {10, 20, 510}, {10, 160, 300}, {10, 20, 110}};
  EXPECT_TRUE(notes_on_place(points, kBody, "vessels").empty());
  EXPECT_THAT(notes_on_place(std::span(points).first(3), kBody, "vessels"),
              testing::ElementsAre(testing::StartsWith("vessels: 67 % of it lies outside")));
}

}  // namespace
}  // namespace xraycast::c_arm_pose_test
