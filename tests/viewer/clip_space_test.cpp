#include "xraycast/sampling/clip_space.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace xraycast::clip_space_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

const BodyBounds kBody{{10, 20, 300}, 60, 40, 1};

View view_at(double angle_deg, double tilt_deg, std::optional<Cone> cone = {}) {
  return {.lao_rad = angle_deg * kRadians,
          .cranial_rad = tilt_deg * kRadians,
          .cone = cone,
          .centre_mm = kBody.centre_mm,
          .width = 320,
          .height = 240,
          .pixel_mm = 1};
}

/// Where OpenGL draws a point: pixels from the lower left corner.
glm::dvec2 drawn_at(const View& view, const glm::dvec3& point_mm) {
  const glm::dvec4 clip = to_clip(view) * glm::dvec4(point_mm, 1);
  return 0.5 * (glm::dvec2(clip) / clip.w + 1.0) * glm::dvec2(view.width, view.height);
}

class ClipSpaceViews : public testing::TestWithParam<View> {};

TEST_P(ClipSpaceViews, DrawPointsWhereTheirRaysMeetTheDetector) {
  const View& view = GetParam();
  for (const auto& [i, j] : {std::pair(0, 0), std::pair(200, 31), std::pair(319, 239)}) {
    const glm::dvec3 pixel = view.pixel_on_detector_mm(i, j);
    const glm::dvec3 on_ray =
        view.cone ? 0.6 * pixel + 0.4 * view.source_mm() : pixel + 50.0 * view.towards_detector();
    const glm::dvec2 place = drawn_at(view, on_ray);
    // Products of doubles of up to 2000.
    EXPECT_NEAR(place.x, i + 0.5, 1e-9);
    EXPECT_NEAR(place.y, view.height - j - 0.5, 1e-9);
  }
}

TEST_P(ClipSpaceViews, BoxesHoldWhatIsWithinTheirCorners) {
  const View& view = GetParam();
  const ScreenBox box = screen_box(view, corners_mm(kBody, view));
  EXPECT_LT(box.width, view.width);
  EXPECT_LT(box.height, view.height);
  for (int around = 0; around < 36; ++around)
    for (const double z : {-1.0, 1.0}) {
      const double phi = around * 10 * kRadians;
      const glm::dvec3 point =
          kBody.centre_mm + glm::dvec3(kBody.radius_mm * std::cos(phi), kBody.radius_mm * std::sin(phi),
                                       z * kBody.half_height_mm);
      const glm::dvec2 place = drawn_at(view, point);
      EXPECT_GE(place.x, box.x);
      EXPECT_GE(place.y, box.y);
      EXPECT_LE(place.x, box.x + box.width);
      EXPECT_LE(place.y, box.y + box.height);
    }
}

INSTANTIATE_TEST_SUITE_P(Views, ClipSpaceViews,
                         testing::Values(view_at(0, 0), view_at(110, 25), view_at(-30, 0, Cone{1000, 1400}),
                                         view_at(200, -20, Cone{700, 1100})));

TEST(ScreenBox, EndsWithThePicture) {
  View view = view_at(0, 0);
  view.pixel_mm = 0.1;
  EXPECT_EQ(screen_box(view, corners_mm(kBody, view)), (ScreenBox{0, 0, 320, 240}));
  view.pixel_mm = 1;
  view.centre_mm.x += 500;
  EXPECT_EQ(screen_box(view, corners_mm(kBody, view)).width, 0);
}

TEST(ScreenBox, IsEverythingWhenSomethingReachesTheSource) {
  const View view = view_at(0, 0, Cone{50, 1400});
  EXPECT_EQ(screen_box(view, corners_mm(kBody, view)), (ScreenBox{0, 0, 320, 240}));
}

TEST(ScreenBox, UnitesWithAnotherAndIgnoresAnEmptyOne) {
  const ScreenBox box{10, 20, 30, 40};
  EXPECT_EQ(united(box, {}), box);
  EXPECT_EQ(united({}, box), box);
  EXPECT_EQ(united(box, {0, 50, 5, 50}), (ScreenBox{0, 20, 40, 80}));
}

}  // namespace
}  // namespace xraycast::clip_space_test
