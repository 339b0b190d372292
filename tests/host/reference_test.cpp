// The reference against closed forms: what the caster and the projector are measured with is measured first.
#include "support/reference.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

namespace xraycast::test::reference_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kRounding = 1e-12;  // relative; sums of some hundred doubles

/// 0 in air, 1 /mm at 0 HU, linear.
double water_is_one(double hu) { return (hu + 1024) / 1024; }

/// Segments that cross the cube of +-40 mm or miss it, some along an axis, some ending inside.
std::vector<std::pair<glm::dvec3, glm::dvec3>> random_segments(int count) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> coordinate_mm(-60, 60);
  const auto place_mm = [&] {
    const double x = coordinate_mm(random), y = coordinate_mm(random), z = coordinate_mm(random);
    return glm::dvec3(x, y, z);
  };
  std::vector<std::pair<glm::dvec3, glm::dvec3>> segments;
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 a_mm = place_mm();
    glm::dvec3 b_mm = place_mm();
    if (i % 8 < 3) {  // along x, y or z
      const glm::dvec3 end_mm = b_mm;
      b_mm = a_mm;
      b_mm[i % 8] = end_mm[i % 8];
    }
    segments.emplace_back(a_mm, b_mm);
  }
  return segments;
}

Volume noise(const Index3& size, const glm::dvec3& spacing_mm) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> hu(-1000, 1000);
  return make_volume(size, spacing_mm, [&](const glm::dvec3&) { return hu(random); });
}

// ---- volumes and samples

TEST(ReferenceVolume, IsCentredRoundedAndClamped) {
  const Volume volume =
      make_volume({3, 2, 1}, {2, 3, 4}, [](const glm::dvec3& p) { return 1e4 * p.x + p.y + p.z; });
  EXPECT_EQ(volume.geometry().origin_mm, glm::dvec3(-2, -1.5, 0));
  EXPECT_THAT(std::vector<int>(volume.hu().begin(), volume.hu().end()),
              testing::ElementsAre(-1024, -2, 19999, -1024, 2, 20002));
}

TEST(ReferenceVolume, RandomBoxesFollowTheSeed) {
  const Box bounds{{-1, -2, -3}, {4, 5, 6}};
  const auto one = random_boxes(50, bounds, 1), same = random_boxes(50, bounds, 1),
             other = random_boxes(50, bounds, 2);
  ASSERT_EQ(one.size(), 50u);
  EXPECT_NE(one[0].lower_mm, other[0].lower_mm);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].upper_mm, same[i].upper_mm);
    EXPECT_TRUE(bounds.contains(one[i].lower_mm) && bounds.contains(one[i].upper_mm));
    EXPECT_TRUE(one[i].contains(0.5 * (one[i].lower_mm + one[i].upper_mm)));
  }
}

TEST(ReferenceSample, IsExactForLinearFields) {
  const Volume volume =
      make_volume({8, 9, 10}, {1, 1, 1}, [](const glm::dvec3& p) { return 2 * p.x - 4 * p.y + 6 * p.z; });
  const glm::dvec3 index(2.3, 5.75, 7.1), world_mm = volume.geometry().to_world_mm(index);
  EXPECT_NEAR(sample_hu(volume, index), 2 * world_mm.x - 4 * world_mm.y + 6 * world_mm.z, 100 * kRounding);
  EXPECT_NEAR(sample_hu(volume, index.x, index.y, 7), sample_hu(volume, {index.x, index.y, 7}),
              100 * kRounding);
}

TEST(ReferenceSample, EndsAtTheBorderVoxelsFaces) {
  const Volume volume = make_volume({4, 4, 4}, {1, 1, 1}, [](const glm::dvec3& p) { return 10 * p.x; });
  EXPECT_EQ(sample_hu(volume, 0, 0, 0), -15);
  EXPECT_EQ(sample_hu(volume, 3, 3, 3), 15);
  EXPECT_EQ(sample_hu(volume, -0.49, 1, 0), -15);  // held from the centre to the face
  EXPECT_EQ(sample_hu(volume, -0.51, 1, 0), -1024);
  EXPECT_EQ(sample_hu(volume, 3.49, 3.49, 0), 15);
  EXPECT_EQ(sample_hu(volume, 1, 3.51, 0), -1024);
  EXPECT_EQ(sample_hu(volume, {3, 1, 3.5}), 15);
}

// ---- maps

TEST(ReferenceMap, StartsAnteriorAndTurnsToThePatientsLeft) {
  EXPECT_LT(glm::distance(radial_direction(0), {0, -1}), kRounding);
  EXPECT_LT(glm::distance(radial_direction(0.5 * kPi), {1, 0}), kRounding);
  EXPECT_DOUBLE_EQ(column_phi_rad(0, 4), 0.25 * kPi);

  // A rod of water on the patient's left, in the superior half only.
  const Volume volume = make_volume({41, 41, 4}, {1, 1, 1}, [](const glm::dvec3& p) {
    return p.z > 0 && glm::distance(glm::dvec2(p), {12, 0}) < 4 ? 0 : -1024;
  });
  const std::vector<glm::dvec2> centres(4, {0, 0});
  const auto map = reference_cylinder_map(volume, centres, std::vector<double>{0, 20}, 36, 0.5, water_is_one);
  const auto strongest = std::ranges::max_element(map) - map.begin();
  EXPECT_THAT(strongest % 36, testing::AnyOf(8, 9));  // the two columns beside 90 degrees
  EXPECT_GT(map[9], 7);                               // row 0: superior
  EXPECT_GT(map[36 + 9], 7);
  EXPECT_EQ(map[2 * 36 + 9], 0);
  EXPECT_EQ(map[3 * 36 + 9], 0);
}

TEST(ReferenceMap, ConstantVolumeGivesEachShellItsThickness) {
  const Volume volume = make_volume({64, 64, 3}, {1, 1.25, 2}, [](const glm::dvec3&) { return 512; });
  const std::vector<glm::dvec2> centres = {{0, 0}, {2.5, -1}, {0.3, 3}};
  const std::vector<double> radii_mm = {1.5, 7.1, 7.35, 20};  // the second shell is thinner than a step
  const auto map = reference_cylinder_map(volume, centres, radii_mm, 20, 0.7, water_is_one);
  ASSERT_EQ(map.size(), 3u * 3 * 20);
  for (std::size_t i = 0; i < map.size(); ++i) {
    const std::size_t layer = i / (3 * 20);
    EXPECT_NEAR(map[i], 1.5 * (radii_mm[layer + 1] - radii_mm[layer]), 100 * kRounding);
  }
}

TEST(ReferenceMap, ShellsAddUpToOneCylinder) {
  const Volume volume = noise({30, 30, 2}, {1, 1, 1});
  const std::vector<glm::dvec2> centres(2, {1, 2});
  const std::vector<double> whole = {0, 13.37}, shells = {0, 3.3, 8.05, 13.37};
  const auto one = reference_cylinder_map(volume, centres, whole, 24, 0.9, water_is_one);
  const auto three = reference_cylinder_map(volume, centres, shells, 24, 0.9, water_is_one);
  for (std::size_t i = 0; i < one.size(); ++i)
    EXPECT_NEAR(three[i] + three[i + one.size()] + three[i + 2 * one.size()], one[i], 100 * kRounding);
}

TEST(ReferenceMap, ConvergesToOffAxisCirclesAndBoxes) {
  const glm::dvec2 axis_mm(3, -5), circle_mm(14, 4), lower_mm(-30, -21), upper_mm(-6, 12);
  constexpr double kRadius_mm = 11;
  constexpr int kAngles = 90;
  const std::vector<double> radii_mm = {0, 12, 32};
  std::vector<double> errors_mm;
  for (const double spacing_mm : {2.0, 1.0, 0.5}) {
    const auto size = static_cast<std::int64_t>(80 / spacing_mm);
    const Volume volume = make_volume({size, size, 1}, glm::dvec3(spacing_mm), [&](const glm::dvec3& p) {
      const bool in_box = p.x > lower_mm.x && p.x < upper_mm.x && p.y > lower_mm.y && p.y < upper_mm.y;
      return in_box || glm::distance(glm::dvec2(p), circle_mm) < kRadius_mm ? 0 : -1024;
    });
    const auto map = reference_cylinder_map(volume, std::vector{axis_mm}, radii_mm, kAngles,
                                            0.25 * spacing_mm, water_is_one);
    double error_mm = 0;
    for (int layer = 0; layer < 2; ++layer) {
      for (int column = 0; column < kAngles; ++column) {
        const double phi_rad = column_phi_rad(column, kAngles), inner_mm = radii_mm[layer],
                     outer_mm = radii_mm[layer + 1];
        const double exact_mm =
            radial_circle_chord_mm(axis_mm, phi_rad, inner_mm, outer_mm, circle_mm, kRadius_mm) +
            radial_box_chord_mm(axis_mm, phi_rad, inner_mm, outer_mm, lower_mm, upper_mm);
        error_mm += std::abs(map[layer * kAngles + column] - exact_mm) / (2 * kAngles);
      }
    }
    errors_mm.push_back(error_mm);
    // A voxelised edge stands half a voxel off at most, and a ray meets two or three.
    EXPECT_LT(error_mm, 0.5 * spacing_mm);
  }
  // First order, as for every sharp edge: half the voxel, half the error, within the luck of where the edges
  // fall.
  EXPECT_LT(errors_mm[1], 0.7 * errors_mm[0]);
  EXPECT_LT(errors_mm[2], 0.7 * errors_mm[1]);
}

// ---- projections

TEST(ReferenceJoseph, IsExactInAConstantVolume) {
  const Volume volume = make_volume({40, 50, 60}, {2, 1.5, 1}, [](const glm::dvec3&) { return 0; });
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate_mm(-28, 28);  // at least a voxel within the border
  for (int i = 0; i < 100; ++i) {
    const glm::dvec3 a_mm(coordinate_mm(random), coordinate_mm(random), coordinate_mm(random));
    const glm::dvec3 b_mm(coordinate_mm(random), coordinate_mm(random), coordinate_mm(random));
    EXPECT_NEAR(reference_joseph(volume, a_mm, b_mm, water_is_one), glm::distance(a_mm, b_mm),
                100 * kRounding);
  }
}

TEST(ReferenceJoseph, SeesTheScansExtentAlongAnAxis) {
  const Volume volume = make_volume({40, 50, 60}, {2, 1.5, 1}, [](const glm::dvec3&) { return 0; });
  EXPECT_NEAR(reference_joseph(volume, {-500, 3, 4}, {500, 3, 4}, water_is_one), 80, 100 * kRounding);
  EXPECT_NEAR(reference_joseph(volume, {3, 500, 4}, {3, -500, 4}, water_is_one), 75, 100 * kRounding);
  EXPECT_NEAR(reference_joseph(volume, {3, 4, -500}, {3, 4, 11.25}, water_is_one), 41.25, 100 * kRounding);
}

TEST(ReferenceJoseph, IsExactForLinearFieldsBetweenPlanes) {
  const Volume volume = make_volume({20, 20, 20}, {1, 1, 1},
                                    [](const glm::dvec3& p) { return 10 * p.x + 20 * p.y - 30 * p.z; });
  // From 5 to 15 planes and a half along x. The mean of a linear field is its value in the middle.
  const glm::dvec3 a_mm = volume.geometry().to_world_mm({4.5, 6.3, 9.2}),
                   b_mm = volume.geometry().to_world_mm({15.5, 12.1, 3.7});
  const glm::dvec3 middle_mm = 0.5 * (a_mm + b_mm);
  const double mean_hu = 10 * middle_mm.x + 20 * middle_mm.y - 30 * middle_mm.z;
  EXPECT_NEAR(reference_joseph(volume, a_mm, b_mm, water_is_one),
              water_is_one(mean_hu) * glm::distance(a_mm, b_mm), 100 * kRounding);
}

TEST(ReferenceJoseph, SingleVoxelIntegratesToItsLength) {
  const Volume volume =
      make_volume({9, 9, 9}, {2, 2, 2}, [](const glm::dvec3& p) { return p == glm::dvec3(0) ? 0 : -1024; });
  EXPECT_NEAR(reference_joseph(volume, {-50, 0, 0}, {50, 0, 0}, water_is_one), 2, 100 * kRounding);
  // Half a voxel beside it, half of it is seen.
  EXPECT_NEAR(reference_joseph(volume, {-50, 1, 0}, {50, 1, 0}, water_is_one), 1, 100 * kRounding);
  EXPECT_NEAR(reference_joseph(volume, {-50, 2, 0}, {50, 2, 0}, water_is_one), 0, 100 * kRounding);
}

TEST(ReferenceJoseph, ReversingTheRayChangesNothing) {
  const Volume volume = noise({20, 20, 20}, {3, 2, 4});
  for (const auto& [a_mm, b_mm] : random_segments(100))
    EXPECT_NEAR(reference_joseph(volume, a_mm, b_mm, water_is_one),
                reference_joseph(volume, b_mm, a_mm, water_is_one), 1e-9);
}

TEST(ReferenceJoseph, MissesAndEmptyRaysAreZero) {
  const Volume volume = make_volume({9, 9, 9}, {1, 1, 1}, [](const glm::dvec3&) { return 0; });
  EXPECT_EQ(reference_joseph(volume, {-50, 8, 0}, {50, 8, 0}, water_is_one), 0);
  EXPECT_EQ(reference_joseph(volume, {-50, 0, 0}, {-20, 0, 0}, water_is_one), 0);
  EXPECT_EQ(reference_joseph(volume, {1, 1, 1}, {1, 1, 1}, water_is_one), 0);
}

TEST(ReferenceJoseph, ConvergesWithTheSquareOfTheSpacing) {
  // A Gaussian ball: smooth, and its line integral is closed. The peak is high, so that rounding to whole HU
  // (half of one in 30,000) stays below the smallest error looked at.
  constexpr double kSigma_mm = 12, kPeak_hu = 30000;
  const auto mu = [](double hu) { return hu / kPeak_hu; };
  std::vector<double> errors_mm;
  for (const double spacing_mm : {8.0, 4.0, 2.0}) {
    const auto size = static_cast<std::int64_t>(128 / spacing_mm);
    const Volume volume = make_volume({size, size, size}, glm::dvec3(spacing_mm), [&](const glm::dvec3& p) {
      return kPeak_hu * std::exp(-glm::dot(p, p) / (2 * kSigma_mm * kSigma_mm));
    });
    double error_mm = 0;
    int rays = 0;
    for (const auto& [a_mm, b_mm] : random_segments(200)) {
      const glm::dvec3 direction = glm::normalize(b_mm - a_mm);
      const double miss_mm = glm::length(glm::cross(a_mm, direction));
      if (miss_mm > 24) continue;
      const glm::dvec3 foot_mm = a_mm - glm::dot(a_mm, direction) * direction;
      const double exact_mm =
          kSigma_mm * std::sqrt(2 * kPi) * std::exp(-miss_mm * miss_mm / (2 * kSigma_mm * kSigma_mm));
      // Air outside would show at the ball's foot, so that the ray stops before the border: 50 mm are 4.2
      // sigma.
      error_mm += std::abs(
          reference_joseph(volume, foot_mm - 50.0 * direction, foot_mm + 50.0 * direction, mu) - exact_mm);
      ++rays;
    }
    errors_mm.push_back(error_mm / rays);
  }
  // Second order asks for 4; the tail beyond 4.2 sigma and the rounding to HU take their share.
  EXPECT_NEAR(errors_mm[0] / errors_mm[1], 4, 0.6);
  EXPECT_NEAR(errors_mm[1] / errors_mm[2], 4, 0.6);
}

TEST(ReferenceLineIntegral, ConvergesWithTheSquareOfTheStep) {
  const auto mu_at = [](const glm::dvec3& p) { return std::sin(p.x) + p.y * p.y; };
  const glm::dvec3 a_mm(0, 0, 0), b_mm(2, 3, 0);
  // Along the ray x = 2 t and y = 3 t: the integral of sin(2 t) + 9 t^2 over 0 to 1, times the length.
  const double exact = ((1 - std::cos(2)) / 2 + 3) * std::sqrt(13.0);
  const auto error = [&](int steps) {
    return reference_line_integral(mu_at, a_mm, b_mm, std::sqrt(13.0) / steps) - exact;
  };
  EXPECT_NEAR(error(10) / error(20), 4, 0.02);
  EXPECT_NEAR(error(20) / error(40), 4, 0.02);
  EXPECT_EQ(reference_line_integral(mu_at, a_mm, a_mm, 1), 0);
}

// ---- closed forms

/// A chord against a fine count of what lies inside. Each of at most two ends is off by half a step.
void expect_chord(double chord_mm, const std::function<bool(const glm::dvec3&)>& contains,
                  const glm::dvec3& a_mm, const glm::dvec3& b_mm) {
  constexpr double kStep_mm = 0.02;
  EXPECT_NEAR(
      chord_mm,
      reference_line_integral([&](const glm::dvec3& p) { return contains(p) ? 1 : 0; }, a_mm, b_mm, kStep_mm),
      kStep_mm);
}

TEST(ClosedForm, ChordsAgreeWithCounting) {
  const Box box{{-20, -10, -35}, {25, 30, 15}};
  const Ellipsoid ellipsoid{{5, -3, 8}, {40, 15, 25}, 0.6};
  const Cylinder cylinder{{-4, 6}, 22, -30, 12};
  int hits = 0;
  for (const auto& [a_mm, b_mm] : random_segments(300)) {
    expect_chord(
        box_chord_mm(a_mm, b_mm, box), [&](const glm::dvec3& p) { return box.contains(p); }, a_mm, b_mm);
    expect_chord(
        ellipsoid_chord_mm(a_mm, b_mm, ellipsoid), [&](const glm::dvec3& p) { return ellipsoid.contains(p); },
        a_mm, b_mm);
    expect_chord(
        cylinder_chord_mm(a_mm, b_mm, cylinder),
        [&](const glm::dvec3& p) {
          return glm::distance(glm::dvec2(p), cylinder.centre_mm) < cylinder.radius_mm &&
                 p.z > cylinder.lower_z_mm && p.z < cylinder.upper_z_mm;
        },
        a_mm, b_mm);
    hits += box_chord_mm(a_mm, b_mm, box) > 0;
  }
  EXPECT_GT(hits, 50);
}

TEST(ClosedForm, RadialChordsAgreeWithCounting) {
  const glm::dvec2 axis_mm(4, -3), circle_mm(-9, 6), lower_mm(-25, -18), upper_mm(12, 9);
  constexpr double kRadius_mm = 14, kInner_mm = 3, kOuter_mm = 22;
  for (int column = 0; column < 60; ++column) {
    const double phi_rad = column_phi_rad(column, 60);
    const glm::dvec3 a_mm(axis_mm + kInner_mm * radial_direction(phi_rad), 0),
        b_mm(axis_mm + kOuter_mm * radial_direction(phi_rad), 0);
    expect_chord(
        radial_circle_chord_mm(axis_mm, phi_rad, kInner_mm, kOuter_mm, circle_mm, kRadius_mm),
        [&](const glm::dvec3& p) { return glm::distance(glm::dvec2(p), circle_mm) < kRadius_mm; }, a_mm,
        b_mm);
    expect_chord(
        radial_box_chord_mm(axis_mm, phi_rad, kInner_mm, kOuter_mm, lower_mm, upper_mm),
        [&](const glm::dvec3& p) {
          return Box{{lower_mm, -1}, {upper_mm, 1}}.contains(p);
        },
        a_mm, b_mm);
  }
}

TEST(ClosedForm, KnownChords) {
  const Box box{{-1, -2, -3}, {1, 2, 3}};
  EXPECT_DOUBLE_EQ(box_chord_mm({-9, 0, 0}, {9, 0, 0}, box), 2);
  EXPECT_DOUBLE_EQ(box_chord_mm({0, 0, 0}, {9, 0, 0}, box), 1);       // source inside
  EXPECT_DOUBLE_EQ(box_chord_mm({0, 0, -1}, {0, 0, 0.5}, box), 1.5);  // both ends inside
  EXPECT_DOUBLE_EQ(box_chord_mm({-9, 2.1, 0}, {9, 2.1, 0}, box), 0);  // past it, along an axis
  EXPECT_DOUBLE_EQ(box_chord_mm({-9, 0, 0}, {-8, 0, 0}, box), 0);     // ends before it
  EXPECT_DOUBLE_EQ(box_chord_mm({0, 0, 0}, {0, 0, 0}, box), 0);
  const Cylinder cylinder{{0, 0}, 2, -3, 3};
  EXPECT_DOUBLE_EQ(cylinder_chord_mm({1, 0, -9}, {1, 0, 9}, cylinder), 6);  // along its axis
  EXPECT_DOUBLE_EQ(cylinder_chord_mm({3, 0, -9}, {3, 0, 9}, cylinder), 0);
  EXPECT_DOUBLE_EQ(cylinder_chord_mm({-9, 0, 0}, {9, 0, 0}, cylinder), 4);
}

TEST(ClosedForm, EllipsoidsAddUp) {
  // As in a head phantom: a skull, and a brain that takes most of it away again.
  const std::vector<Ellipsoid> head = {{{0, 0, 0}, {10, 20, 30}, 0, 2}, {{0, 0, 0}, {9, 18, 27}, 0, -1.5}};
  EXPECT_NEAR(ellipsoids_line_integral({-99, 0, 0}, {99, 0, 0}, head), 2 * 20 - 1.5 * 18, 100 * kRounding);
  EXPECT_NEAR(ellipsoids_line_integral({0, -99, 0}, {0, 99, 0}, head), 2 * 40 - 1.5 * 36, 100 * kRounding);
  EXPECT_NEAR(ellipsoids_line_integral({0, 0, -99}, {0, 0, 99}, head), 2 * 60 - 1.5 * 54, 100 * kRounding);
  // A quarter of a turn swaps x and y.
  const Ellipsoid turned{{0, 0, 0}, {10, 20, 30}, 0.5 * kPi};
  EXPECT_NEAR(ellipsoid_chord_mm({-99, 0, 0}, {99, 0, 0}, turned), 40, 100 * kRounding);
}

}  // namespace
}  // namespace xraycast::test::reference_test
