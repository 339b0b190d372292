#include "xraycast/scene/device_tubes.hpp"

#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/scene/device_surface.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

namespace xraycast::device_tubes_test {
namespace {

std::vector<Surface> stent_surfaces(const StentModel& stent, const std::vector<double>& radii_mm,
                                    const std::function<glm::dvec3(double)>& axis_mm) {
  return device_surfaces(stent_tubes(stent, radii_mm, axis_mm));
}

std::vector<Surface> treating_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                       const InstrumentModel& instrument, const TreatingView& view) {
  return device_surfaces(treating_tubes(nodes_mm, instrument, view));
}

TEST(StentSurface, LiesOnItsCylinder) {
  const StentModel stent = *InstrumentModel::named("stent-6x18").stent();
  const std::vector<Surface> surfaces = stent_surfaces(
      stent, std::vector<double>(7, 3), [](double beyond_mm) { return glm::dvec3(1, 2, beyond_mm); });
  ASSERT_EQ(surfaces.size(), static_cast<std::size_t>(stent.rings + (stent.rings - 1) * stent.links));
  float lowest_mm = 0, highest_mm = 0;
  for (const Surface& surface : surfaces) {
    check(surface);
    EXPECT_GT(volume_mm3(surface.mesh), 0);
    for (const glm::vec3& point : surface.mesh.points_mm) {
      const double from_axis_mm = std::hypot(point.x - 1.0F, point.y - 2.0F);
      // Of a strut half as thick at most; a chord between crowns 15 degrees apart cuts 0.026 mm, and the
      // mitre at a crown sticks out by its sharpness.
      EXPECT_NEAR(from_axis_mm, 3, 0.06 + 0.2);
      lowest_mm = std::min(lowest_mm, point.z);
      highest_mm = std::max(highest_mm, point.z);
    }
  }
  // 18 mm long, and the wire's thickness with its mitres.
  EXPECT_NEAR(highest_mm - lowest_mm, 18, 0.5);
  EXPECT_GT(highest_mm - lowest_mm, 18);
}

TEST(StentSurface, LinksJoinCrowns) {
  const StentModel stent = *InstrumentModel::named("stent-6x18").stent();
  const std::vector<Surface> surfaces = stent_surfaces(
      stent, std::vector<double>(7, 3), [](double beyond_mm) { return glm::dvec3(0, 0, beyond_mm); });
  // Ring, three links, ring: the first link's ends lie within a strut's thickness of a point of either ring.
  const auto nearest_mm = [](const Surface& ring, const glm::vec3& point) {
    float nearest = 1e9F;
    for (const glm::vec3& other : ring.mesh.points_mm)
      nearest = std::min(nearest, glm::distance(other, point));
    return nearest;
  };
  const std::vector<glm::vec3>& link = surfaces[1].mesh.points_mm;
  EXPECT_LT(nearest_mm(surfaces[0], link.front()), 0.12F);
  EXPECT_LT(nearest_mm(surfaces[4], link.back()), 0.12F);
}

TEST(BalloonSurface, IsAsWideAsItIsFilled) {
  const InstrumentModel model = InstrumentModel::named("stent-6x18");
  std::vector<glm::dvec3> nodes_mm;
  for (int i = 0; i <= 60; ++i) nodes_mm.emplace_back(0, 0, 2 * i);
  const auto width_mm = [&](const Surface& surface) {
    float widest = 0;
    for (const glm::vec3& point : surface.mesh.points_mm)
      widest = std::max(widest, std::hypot(point.x, point.y));
    return 2 * widest;
  };
  const std::vector<Surface> folded = treating_surfaces(nodes_mm, model, {}),
                             filled = treating_surfaces(nodes_mm, model, {.bar = 8}),
                             carried = treating_surfaces(nodes_mm, model, {.bar = 8, .carried_rings = 7});
  ASSERT_EQ(folded.size(), 1u);
  EXPECT_TRUE(folded[0].mesh.points_mm.empty());
  for (const Surface& surface : filled) check(surface);
  EXPECT_NEAR(width_mm(filled[0]), 6, 0.01);
  // 20 mm of cylinder, whose middle is 18 mm from the tip at 120 mm, and cones.
  double middle_mm = 0;
  for (const glm::vec3& point : filled[0].mesh.points_mm) middle_mm += point.z;
  EXPECT_NEAR(middle_mm / static_cast<double>(filled[0].mesh.points_mm.size()), 102, 0.1);
  EXPECT_GT(carried.size(), 1u);
  EXPECT_NEAR(width_mm(carried[1]), 6.24, 0.3);
  EXPECT_TRUE(treating_surfaces(nodes_mm, InstrumentModel::named("cobra-5f"), {}).empty());
}

TEST(SheathSurface, CarriesTheRingsThatAreNotFree) {
  const InstrumentModel model = InstrumentModel::named("stent-self-8x40");
  std::vector<glm::dvec3> nodes_mm;
  for (int i = 0; i <= 60; ++i) nodes_mm.emplace_back(0, 0, 2 * i);
  const auto ends_mm = [](const std::vector<Surface>& surfaces, std::size_t first) {
    float lowest = 1e9F, highest = -1e9F;
    for (std::size_t s = first; s < surfaces.size(); ++s)
      for (const glm::vec3& point : surfaces[s].mesh.points_mm) {
        lowest = std::min(lowest, point.z);
        highest = std::max(highest, point.z);
        // In the instrument.
        EXPECT_LT(std::hypot(point.x, point.y), 1.0F);
      }
    return std::pair(lowest, highest);
  };
  const std::vector<Surface> whole = treating_surfaces(nodes_mm, model, {.carried_rings = 16}),
                             half =
                                 treating_surfaces(nodes_mm, model, {.carried_rings = 8, .release_mm = 21}),
                             none = treating_surfaces(nodes_mm, model, {.release_mm = 42});
  // The sheath's marker, 16 rings with four links from each to the next.
  ASSERT_EQ(whole.size(), 1u + 16 + 15 * 4);
  ASSERT_EQ(half.size(), 1u + 8 + 7 * 4);
  ASSERT_EQ(none.size(), 1u);
  for (const Surface& surface : half) check(surface);
  // From 12 mm behind the tip, at 120 mm, over 42.4 mm; a strut is 0.2 mm thick.
  EXPECT_NEAR(ends_mm(whole, 1).second, 108, 0.3);
  EXPECT_NEAR(ends_mm(whole, 1).first, 108 - 42.4, 0.3);
  EXPECT_NEAR(ends_mm(half, 1).first, 108 - 42.4, 0.3);
  EXPECT_NEAR(ends_mm(half, 1).second, 108 - 0.5 * (42.4 + 0.6), 0.3);
  // The sheath's marker, a millimetre long, goes back with it.
  EXPECT_NEAR(whole[0].mesh.points_mm.front().z - half[0].mesh.points_mm.front().z, 21, 0.1);
  EXPECT_LT(whole[1].mu_per_mm,
            stent_surfaces(*InstrumentModel::named("stent-6x18").stent(), std::vector<double>{3},
                           [](double mm) { return glm::dvec3(0, 0, mm); })[0]
                .mu_per_mm)
      << "nitinol absorbs less than cobalt-chromium";
}

double length_mm(const DeviceTube& tube) {
  double sum_mm = 0;
  for (std::size_t i = 1; i < tube.points.size(); ++i)
    sum_mm += glm::distance(tube.points[i].position_mm, tube.points[i - 1].position_mm);
  return sum_mm;
}

TEST(CoilTube, IsOfPlatinumAlongTheCoilAndHangsFromItsCatheter) {
  LaidCoil coil{.model = {.loop_mm = 10, .length_mm = 300, .wire_mm = 0.36}};
  for (int i = 0; i <= 20; ++i) coil.points_mm.push_back({0.5 * i, 0, 0});
  const glm::dvec3 tip_mm(10, 3, 0);
  const DeviceTube hangs = coil_tube(coil, tip_mm);
  EXPECT_EQ(hangs.matter, DeviceMatter::platinum);
  // Straight lines: rounding.
  EXPECT_NEAR(length_mm(hangs), 10 + 3, 1e-12);
  coil.is_detached = true;
  EXPECT_NEAR(length_mm(coil_tube(coil)), 10, 1e-12);
  // A spring of 0.36 mm that is wound of 0.06 mm: as much metal as pi^2 / 4 d (D - d).
  const double full_mm = 2 * hangs.points[0].radius_mm,
               spring_mm2 = 0.25 * std::numbers::pi * std::numbers::pi * 0.06 * 0.3;
  EXPECT_NEAR(0.25 * std::numbers::pi * full_mm * full_mm, spring_mm2, 0.02 * spring_mm2)
      << "of two decimals";
  check(device_surface(hangs));
  coil.points_mm.resize(1);
  EXPECT_TRUE(coil_tube(coil).points.empty());
}

TEST(CoilTube, LiesInItsCatheterAsFarAsItIsNotOut) {
  std::vector<glm::dvec3> around_mm;
  for (int i = 0; i <= 100; ++i) around_mm.push_back({0, 0, 5.0 * i});
  PushedCoil coil{.model = {.loop_mm = 10, .length_mm = 300, .wire_mm = 0.36}, .out_mm = -50};
  const DeviceTube within = pushed_coil_tube(coil, around_mm);
  // Of a straight catheter, whose curve is that: rounding.
  EXPECT_NEAR(within.points.front().position_mm.z, 450, 1e-6);
  EXPECT_NEAR(length_mm(within), 300, 1e-6);
  coil.out_mm = 120;
  EXPECT_NEAR(length_mm(pushed_coil_tube(coil, around_mm)), 180, 1e-6);
  EXPECT_NEAR(pushed_coil_tube(coil, around_mm).points.front().position_mm.z, 500, 1e-6);
  coil.out_mm = -400;
  EXPECT_NEAR(length_mm(pushed_coil_tube(coil, around_mm)), 100, 1e-6) << "the rest has yet to enter";
  coil.out_mm = 300;
  EXPECT_TRUE(pushed_coil_tube(coil, around_mm).points.empty());
}

}  // namespace
}  // namespace xraycast::device_tubes_test
