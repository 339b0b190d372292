#include "xraycast/scene/pulse_blur.hpp"

#include <gtest/gtest.h>

namespace xraycast::pulse_blur_test {
namespace {

Surface at(float x_mm) {
  Surface surface;
  surface.mesh.points_mm = {{x_mm, 0, 0}, {x_mm, 1, 0}, {x_mm, 0, 1}};
  surface.mesh.triangles = {{0, 1, 2}};
  surface.mu_per_mm = 0.3;
  return surface;
}

TEST(PulseBlur, SpreadsWhatMovesOverThePulse) {
  const auto seen = seen_by_pulse({at(-0.4f), at(5)}, {at(0), at(5)}, {at(0.4f), at(5)}, 1);
  ASSERT_EQ(seen.size(), 6);
  for (const std::size_t s : {0, 1, 2, 4}) EXPECT_EQ(seen[s].mu_per_mm, 0.3) << s;
  EXPECT_EQ(seen[0].pulse_steps | seen[2].pulse_steps | seen[4].pulse_steps, kWholePulse);
  EXPECT_EQ(seen[0].pulse_steps + seen[2].pulse_steps + seen[4].pulse_steps, kWholePulse)
      << "one after another";
  EXPECT_EQ(seen[0].mesh.points_mm[0].x, 0);
  EXPECT_EQ(seen[2].mesh.points_mm[0].x, -0.4f);
  EXPECT_EQ(seen[4].mesh.points_mm[0].x, 0.4f);
  EXPECT_EQ(seen[1].pulse_steps, kWholePulse) << "it rests";
  EXPECT_TRUE(seen[3].mesh.points_mm.empty());
  EXPECT_TRUE(seen[5].mesh.points_mm.empty());
}

TEST(PulseBlur, LeavesWhatMovesByLessThanHalfAPixel) {
  for (const double pixel_mm : {1.0, 2.0}) {
    const auto seen = seen_by_pulse({at(-0.4f)}, {at(0)}, {at(0.4f)}, pixel_mm);
    EXPECT_EQ(seen[1].mesh.points_mm.empty(), pixel_mm == 2) << pixel_mm;
  }
}

TEST(PulseBlur, LeavesASurfaceWhosePointsAreOthers) {
  Surface longer = at(9);
  longer.mesh.points_mm.emplace_back(9, 1, 1);
  EXPECT_TRUE(seen_by_pulse({at(0)}, {at(0)}, {longer}, 1)[1].mesh.points_mm.empty());
}

TEST(PulseBlur, GoesOnAsItCame) {
  const std::vector<glm::dvec3> before{{0, 0, 0}, {1, 0, 0}}, now{{0, 0, 1}, {1, 2, 0}};
  const auto later = moved_on(now, before, 0.01, 0.005);
  EXPECT_NEAR(later[0].z, 1.5, 1e-12);
  EXPECT_NEAR(later[1].y, 3, 1e-12);
  EXPECT_EQ(moved_on(now, std::vector<glm::dvec3>(3), 0.01, 0.005), now) << "nodes have come in";
  EXPECT_EQ(moved_on(now, before, 0, 0.005), now);
}

TEST(PulseBlur, CountsPixelsAtTheAxis) {
  EXPECT_EQ(pixel_at_axis_mm({.pixel_mm = 0.4}), 0.4);
  EXPECT_NEAR(pixel_at_axis_mm({.cone = Cone{600, 1200}, .pixel_mm = 0.4}), 0.2, 1e-12);
}

}  // namespace
}  // namespace xraycast::pulse_blur_test
