// Maps of the projections sphere and rectangle, and cylinders about a line.
#include "support/lengths.hpp"
#include "support/reference.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/projection/projector.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast::test::sphere_cl_test {
namespace {

std::vector<float> cast_map(const Volume& volume, const MapGeometry& geometry,
                            ScanStorage storage = ScanStorage::bricks) {
  ComputeDevice device;
  Progress progress;
  return cast(upload(device, volume, storage), geometry, lengths(), progress).map.tau;
}

TEST(OutlinedSphereCast, HomogeneousMatterGivesTheShellsThicknessInThatDirection) {
  const Volume volume = make_volume({90, 90, 60}, {1, 1, 1.5}, [](const glm::dvec3&) { return 0; });
  const MapGeometry circles =
      sphere_map(volume.geometry(), 64, shell_radii_mm(RadiiRule::near_skin, 6, 38), {1, -2, 0.5});
  std::vector<float> outline_mm;
  for (int i = 0; i < circles.width * circles.height; ++i)
    outline_mm.push_back(static_cast<float>(30 + 8 * std::sin(0.05 * i)));
  const MapGeometry map = with_outline(circles, outline_mm);
  const auto tau = cast_map(volume, map);
  const std::size_t layer = outline_mm.size();
  for (std::size_t i = 0; i < tau.size(); ++i) {
    const double scale = outline_mm[i % layer] / map.radius_mm();
    // As under circles.
    ASSERT_NEAR(tau[i], scale * (map.radii_mm[i / layer + 1] - map.radii_mm[i / layer]), 1e-3)
        << "texel " << i;
  }
}

/// Water in a ball, its edge over one voxel.
Volume ball(const glm::dvec3& centre_mm, double radius_mm) {
  return make_volume({90, 90, 60}, {1, 1, 1.5}, [&](const glm::dvec3& p) {
    return -1024 + 1024 * std::clamp(0.5 + radius_mm - glm::distance(p, centre_mm), 0.0, 1.0);
  });
}

glm::dvec3 direction_of(const MapGeometry& map, int column, int row) {
  const double phi = map.phi_rad(column), theta = map.theta_rad(row);
  return {std::sin(theta) * std::sin(phi), -std::sin(theta) * std::cos(phi), std::cos(theta)};
}

TEST(SphereMap, OfACentredBallIsConstantPolesIncluded) {
  const Volume volume = ball({0, 0, 0}, 30);
  const auto tau = cast_map(volume, sphere_map(volume.geometry(), 90, {0, 40}, {0, 0, 0}));
  // The edge's voxels are 1.5 mm high: their linear interpolation moves it by a small part of that.
  for (std::size_t i = 0; i < tau.size(); ++i) ASSERT_NEAR(tau[i], 30, 0.25) << "texel " << i;
}

TEST(SphereMap, ShellsInsideHomogeneousMatterHoldTheirThickness) {
  const Volume volume = ball({0, 0, 0}, 42);
  const auto radii_mm = shell_radii_mm(RadiiRule::equal_area, 6, 38);
  const MapGeometry map = sphere_map(volume.geometry(), 64, radii_mm, {1, -2, 0.5});
  const auto tau = cast_map(volume, map);
  for (std::size_t i = 0; i < tau.size(); ++i) {
    const std::size_t k = i / (64 * 32);
    // 24-bit floats over 38 mm.
    ASSERT_NEAR(tau[i], radii_mm[k + 1] - radii_mm[k], 1e-3) << "texel " << i;
  }
}

TEST(SphereMap, OfAnOffCentreBallIsItsChord) {
  const glm::dvec3 ball_mm(8, -5, 6), eye_mm(-4, 3, -2);
  const Volume volume = ball(ball_mm, 25);
  const MapGeometry map = sphere_map(volume.geometry(), 90, {0, 15, 44}, eye_mm);
  const auto tau = cast_map(volume, map);
  const Ellipsoid truth{ball_mm, glm::dvec3(25)};
  for (int k = 0; k < 2; ++k)
    for (int row = 0; row < map.height; ++row)
      for (int column = 0; column < map.width; ++column) {
        const glm::dvec3 d = direction_of(map, column, row);
        const double chord_mm =
            ellipsoid_chord_mm(eye_mm + map.radii_mm[k] * d, eye_mm + map.radii_mm[k + 1] * d, truth);
        // Across the edge, half a step of 1 mm.
        ASSERT_NEAR(tau[static_cast<std::size_t>((k * map.height + row) * map.width + column)], chord_mm, 0.6)
            << "layer " << k << ", row " << row << ", column " << column;
      }
}

TEST(SphereMap, LayersAddUpToTheSingleSphere) {
  const Volume volume = ball({8, -5, 6}, 25);
  const auto layered = cast_map(
      volume, sphere_map(volume.geometry(), 64, shell_radii_mm(RadiiRule::equal_area, 9, 41.3), {0, 0, 0}));
  const auto whole = cast_map(volume, sphere_map(volume.geometry(), 64, {0, 41.3}, {0, 0, 0}));
  for (std::size_t i = 0; i < whole.size(); ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < 9; ++k) sum += layered[k * whole.size() + i];
    // 1e-5 of the largest depth, for sums of 24-bit floats.
    ASSERT_NEAR(sum, whole[i], 1e-5 * 42);
  }
}

TEST(SphereMap, PointsWhereItsTextSays) {
  const Volume volume = make_volume({60, 60, 60}, {1, 1, 1}, [](const glm::dvec3& p) {
    return p.x > 10 && std::abs(p.y) < 6 && std::abs(p.z) < 6 ? 0
           : p.z > 15 && std::hypot(p.x, p.y) < 8             ? 0
                                                              : -1024;
  });
  const MapGeometry map = sphere_map(volume.geometry(), 72, {0, 29}, {0, 0, 0});
  const auto tau = cast_map(volume, map);
  EXPECT_GT(tau[18 * 72 + 18], 10);  // equator, towards the patient's left
  EXPECT_EQ(tau[18 * 72 + 54], 0);   // right
  EXPECT_GT(tau[0], 10);             // superior pole
  EXPECT_EQ(tau[35 * 72], 0);        // inferior pole
}

TEST(SphereMap, IsTheSameFromImages) {
  ComputeDevice device;
  if (!device.self_test().images) GTEST_SKIP() << "the device has no usable images";
  const Volume volume = ball({8, -5, 6}, 25);
  const MapGeometry map = sphere_map(volume.geometry(), 48, {0, 15, 44}, {1, 2, 3});
  const auto bricks = cast_map(volume, map), images = cast_map(volume, map, ScanStorage::image);
  // As nanodrr compares its back ends: 1e-4 of the maximum.
  for (std::size_t i = 0; i < bricks.size(); ++i) ASSERT_NEAR(images[i], bricks[i], 1e-4 * 30);
}

TEST(SphereMap, RefusesACentreOutside) {
  const VolumeGeometry volume = centred_geometry({20, 20, 20}, {1, 1, 1});
  EXPECT_THROW(sphere_map(volume, 90, {0, 10}, {0, 0, 50}), InputError);
  EXPECT_THROW(sphere_map(volume, 0, {0, 10}, {0, 0, 0}), InputError);
}

TEST(RectangleMap, HoldsTheParallelProjections) {
  const Volume volume = ball({8, -5, 6}, 25);
  const MapGeometry map = rectangle_map(volume.geometry(), 6, 40, {2, 1});
  EXPECT_EQ(map.layers(), 6);
  const auto tau = cast_map(volume, map);
  for (int k = 0; k < 6; ++k) {
    View view{.lao_rad = k * std::numbers::pi / 6,
              .centre_mm = {2, 1, 0},
              .width = map.width,
              .height = map.height,
              .pixel_mm = map.row_spacing_mm};
    for (int j = 0; j < map.height; j += 7)
      for (int i = 0; i < map.width; i += 5) {
        const glm::dvec3 pixel_mm = view.pixel_on_detector_mm(i, j), along = 200.0 * view.towards_detector();
        const double chord_mm =
            ellipsoid_chord_mm(pixel_mm - along, pixel_mm + along, {{8, -5, 6}, glm::dvec3(25)});
        // A ray that grazes the ball meets an edge of half a voxel: sqrt(2 * 25 * 0.5 * 1.5) mm on both
        // sides.
        const double tolerance_mm = chord_mm < 25 ? 12 : 1.5;
        ASSERT_NEAR(tau[static_cast<std::size_t>((k * map.height + j) * map.width + i)], chord_mm,
                    tolerance_mm)
            << "view " << k << ", pixel " << i << ", " << j;
      }
  }
}

TEST(RectangleMap, HoldsWhatLiesWithinItsRadius) {
  // Water everywhere, from which the map takes a cylinder.
  const Volume volume = make_volume({90, 90, 20}, {1, 1, 1.5}, [](const glm::dvec3&) { return 0; });
  const MapGeometry map = rectangle_map(volume.geometry(), 7, 30, {4, -6});
  const auto tau = cast_map(volume, map);
  for (int k = 0; k < map.layers(); ++k)
    for (int i = 0; i < map.width; ++i) {
      const double offset_mm = (i + 0.5 - 0.5 * map.width) * map.row_spacing_mm;
      const double chord_mm = 2 * std::sqrt(std::max(0.0, (30 - offset_mm) * (30 + offset_mm)));
      // 24-bit floats of positions up to 90 mm; a chord that grazes the circle doubles their digits' loss.
      ASSERT_NEAR(tau[static_cast<std::size_t>((k * map.height + 10) * map.width + i)], chord_mm, 1e-3)
          << "view " << k << ", column " << i;
    }
}

TEST(RectangleMap, RefusesNoViews) {
  const VolumeGeometry volume = centred_geometry({20, 20, 20}, {1, 1, 1});
  EXPECT_THROW(rectangle_map(volume, 0, 10, {0, 0}), InputError);
  EXPECT_THROW(rectangle_map(volume, 4, 0, {0, 0}), InputError);
  EXPECT_THROW(rectangle_map(volume, 4, 1e9, {0, 0}), InputError);
}

TEST(CylinderMapAboutALine, EqualsTheReferenceSliceBySlice) {
  const Volume volume = make_volume({60, 60, 33}, {1, 1, 2}, [](const glm::dvec3& p) {
    return 200 * std::sin(p.x / 7) + 9 * p.y - 4 * p.z - 300;
  });
  std::vector<glm::dvec2> centre_mm;
  for (int row = 0; row < 33; ++row) centre_mm.emplace_back(0.4 * row - 6, 5 * std::sin(0.2 * row));
  const auto radii_mm = shell_radii_mm(RadiiRule::equal_area, 4, 22);
  const MapGeometry map = cylinder_map(volume.geometry(), 60, radii_mm, centre_mm);
  const auto expected = reference_cylinder_map(volume, centre_mm, radii_mm, 60, map.step_mm,
                                               [](double hu) { return lengths().mu_per_mm(hu); });
  for (const ScanStorage storage : {ScanStorage::bricks, ScanStorage::image}) {
    const auto tau = cast_map(volume, map, storage);
    // 1e-5 of the largest depth, for sums of 24-bit floats.
    for (std::size_t i = 0; i < expected.size(); ++i)
      ASSERT_NEAR(tau[i], expected[i], 1e-5 * *std::ranges::max_element(expected));
  }
}

}  // namespace
}  // namespace xraycast::test::sphere_cl_test
