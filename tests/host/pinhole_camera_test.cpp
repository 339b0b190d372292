#include "xraycast/projection/pinhole_camera.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

namespace xraycast::test::pinhole_camera_test {
namespace {

View some_view() {
  return {.lao_rad = 0.5,
          .cranial_rad = -0.3,
          .cone = Cone{800, 1200},
          .centre_mm = {5, -6, 7},
          .width = 40,
          .height = 30,
          .pixel_mm = 1.5};
}

TEST(PinholeCamera, ShowsAViewsPixelsWhereTheyAre) {
  const View view = some_view();
  const PinholeCamera camera = camera_of(view);
  // A proper rotation, as OpenCV expects it. 1e-9: double precision over a metre.
  EXPECT_NEAR(glm::determinant(camera.rotation), 1, 1e-12);
  EXPECT_LT(glm::distance(camera.source_mm(), view.source_mm()), 1e-9);
  for (const auto& [i, j] : {std::pair{0, 0}, {39, 0}, {0, 29}, {17, 23}}) {
    const glm::dvec3 seen =
        camera.intrinsics * (camera.rotation * view.pixel_on_detector_mm(i, j) + camera.translation_mm);
    EXPECT_NEAR(seen.z, 1200, 1e-9);
    EXPECT_NEAR(seen.x / seen.z, i, 1e-9);
    EXPECT_NEAR(seen.y / seen.z, j, 1e-9);
    const glm::dvec3 hit_mm = camera.source_mm() + 1200.0 * camera.ray_mm(i, j);
    EXPECT_LT(glm::distance(hit_mm, view.pixel_on_detector_mm(i, j)), 1e-9);
  }
}

TEST(PinholeCamera, RejectsMatricesThatAreNone) {
  const auto message_of = [](const std::function<void(PinholeCamera&)>& damage) -> std::string {
    PinholeCamera camera = camera_of(some_view());
    damage(camera);
    try {
      validate(camera, "camera");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message_of([](PinholeCamera&) {}), "accepted");
  EXPECT_EQ(message_of([](PinholeCamera& c) { c.rotation[0] = -c.rotation[0]; }), "accepted");
  using testing::HasSubstr;
  EXPECT_THAT(message_of([](PinholeCamera& c) { c.intrinsics[0][0] = 0; }), HasSubstr("no focal length"));
  EXPECT_THAT(message_of([](PinholeCamera& c) { c.intrinsics[2][2] = 2; }), HasSubstr("last row"));
  EXPECT_THAT(message_of([](PinholeCamera& c) { c.rotation *= 1.001; }), HasSubstr("rotation"));
  EXPECT_THAT(
      message_of([](PinholeCamera& c) { c.translation_mm.x = std::numeric_limits<double>::infinity(); }),
      HasSubstr("at most"));
  EXPECT_THAT(message_of([](PinholeCamera& c) { c.translation_mm.z = 1e7; }), HasSubstr("at most"));
  EXPECT_THAT(message_of([](PinholeCamera& c) { c.width = 0; }), HasSubstr("1 to 16384"));
}

}  // namespace
}  // namespace xraycast::test::pinhole_camera_test
