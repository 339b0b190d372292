#include "xraycast/scene/absorbing_surfaces.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/pulse_blur.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <vector>

namespace xraycast::absorbing_surfaces_test {
namespace {

constexpr double kRadius_mm = 10, kMu_per_mm = 0.01;
constexpr int kSides = 96;
// Of a circle's chord, what flat sides take away on either side.
constexpr double kFlatness_mm = 2 * kRadius_mm * (1 - std::cos(std::numbers::pi / kSides));

/// A rod of 120 mm about a centre, with round ends.
Surface rod(const glm::dvec3& centre_mm, const glm::dvec3& along, double radius_mm = kRadius_mm,
            double mu_per_mm = kMu_per_mm) {
  VesselBranch branch;
  for (const double s : {-60.0, 60.0}) branch.points.push_back({centre_mm + s * along, radius_mm});
  return {tube_mesh(VesselTree({branch}, "rod"), kSides), mu_per_mm};
}

/// Two rods that cross as one mesh.
Surface cross(double apart_mm) {
  Surface both = rod({0, 0, 0}, {1, 0, 0});
  const Surface other = rod({0, apart_mm, 0}, {0, 0, 1});
  const auto first = static_cast<std::uint32_t>(both.mesh.points_mm.size());
  both.mesh.points_mm.insert(both.mesh.points_mm.end(), other.mesh.points_mm.begin(),
                             other.mesh.points_mm.end());
  for (const auto& [a, b, c] : other.mesh.triangles)
    both.mesh.triangles.push_back({a + first, b + first, c + first});
  return both;
}

View view_at(double angle_deg, std::optional<Cone> cone = {}) {
  return {.lao_rad = angle_deg * std::numbers::pi / 180,
          .cone = cone,
          .width = 161,
          .height = 161,
          .pixel_mm = cone ? 1.5 : 1.0};
}

/// Lengths of the rays in matter of kMu_per_mm, the lowest row first.
std::vector<double> lengths_mm(const std::vector<Surface>& surfaces, const View& view) {
  AbsorbingSurfaces absorbing;
  absorbing.set(surfaces);
  const std::vector<float> tau = absorbing.tau(view, {0, 0, view.width, view.height});
  std::vector<double> lengths;
  for (const float t : tau) lengths.push_back(t / kMu_per_mm);
  return lengths;
}

/// Of a parallel ray through a rod, `off_mm` from its axis.
double chord_mm(double off_mm) {
  return 2 * std::sqrt(std::max(0.0, kRadius_mm * kRadius_mm - off_mm * off_mm));
}

TEST(AbsorbingSurfaces, RodsThatCrossAreTheirUnion) {
  const View view = view_at(0);
  for (const double apart_mm : {0.0, 8.0, 15.0, 30.0}) {
    // As two surfaces, and as one that crosses itself.
    const auto two = lengths_mm({rod({0, 0, 0}, {1, 0, 0}), rod({0, apart_mm, 0}, {0, 0, 1})}, view);
    const auto one = lengths_mm({cross(apart_mm)}, view);
    for (const auto& lengths : {two, one})
      for (int j = 0; j < view.height; j += 3)
        for (int i = 0; i < view.width; i += 3) {
          const double x = i - 80, z = j - 80;
          if (std::max(std::abs(x), std::abs(z)) > 55) continue;  // round ends
          // Two intervals along the ray, their middles apart.
          const double a = chord_mm(z), b = chord_mm(x);
          const double shared =
              a > 0 && b > 0 ? std::clamp(0.5 * (a + b) - apart_mm, 0.0, std::min(a, b)) : 0.0;
          // Flat sides of two rods, which a ray meets at up to 64 deg; near its outline a chord falls
          // steeply, and a flat side's height there is half a chord of this.
          const double outline_mm = std::sqrt(2 * kRadius_mm * kFlatness_mm);
          const double inwards_mm =
              std::min(std::abs(std::abs(x) - kRadius_mm), std::abs(std::abs(z) - kRadius_mm));
          EXPECT_NEAR(lengths[static_cast<std::size_t>(j) * view.width + i], a + b - shared,
                      inwards_mm < 1 ? 2 * outline_mm : 2.3 * 2 * kFlatness_mm)
              << apart_mm << " apart, at " << x << ", " << z;
        }
  }
}

TEST(AbsorbingSurfaces, WhatAbsorbsMostCounts) {
  // A catheter of 2 mm radius and five times the absorption within a vessel, drawn in either order.
  const Surface vessel = rod({0, 0, 0}, {1, 0, 0}), catheter = rod({0, 3, 0}, {1, 0, 0}, 2, 5 * kMu_per_mm);
  const View view = view_at(0);
  for (const auto& surfaces : {std::vector{vessel, catheter}, std::vector{catheter, vessel}})
    EXPECT_NEAR(lengths_mm(surfaces, view)[80 * 161 + 80], 16 + 5 * 4, 4 * kFlatness_mm);
  // A catheter in denser blood adds nothing.
  Surface thin = catheter;
  thin.mu_per_mm = 0.5 * kMu_per_mm;
  EXPECT_NEAR(lengths_mm({vessel, thin}, view)[80 * 161 + 80], 20, 2 * kFlatness_mm);
}

TEST(AbsorbingSurfaces, ARayUnderAConeIsLongerOffTheMiddle) {
  const View view = view_at(0, Cone{1000, 1500});
  const auto lengths = lengths_mm({rod({0, 0, 0}, {1, 0, 0}), rod({0, 0, 0}, {0, 0, 1})}, view);
  // 40 mm to the side in the plane of the axis, where only the rod along x is: its chord of 20 mm along the
  // beam, by the ray's slope.
  EXPECT_NEAR(lengths[80 * 161 + 120], 20 * std::hypot(1000.0, 40.0) / 1000, 2 * kFlatness_mm);
  EXPECT_NEAR(lengths[80 * 161 + 80], 20, 2 * kFlatness_mm);
}

TEST(AbsorbingSurfaces, EveryRayLeavesWhatItEnters) {
  // Pictures in which pixels' middles lie on corners and edges: rays would slip through between triangles,
  // and then run on to the next surface, 400 mm away.
  Surface box{{{}, {}}, kMu_per_mm};
  for (int i = 0; i < 8; ++i)
    box.mesh.points_mm.emplace_back(i & 1 ? 30.5 : -30.5, i & 2 ? 30.5 : -30.5, i & 4 ? 30.5 : -30.5);
  for (const auto& [a, b, c, d] : {std::array<std::uint32_t, 4>{0, 2, 3, 1},
                                   {4, 5, 7, 6},
                                   {0, 1, 5, 4},
                                   {2, 6, 7, 3},
                                   {0, 4, 6, 2},
                                   {1, 3, 7, 5}}) {
    box.mesh.triangles.push_back({a, b, c});
    box.mesh.triangles.push_back({a, c, d});
  }
  ASSERT_GT(volume_mm3(box.mesh), 0);
  Surface far = box;
  for (glm::vec3& point : far.mesh.points_mm) point.y += 400;
  for (const double angle_deg : {0.0, 90.0, 180.0}) {
    const View view = view_at(angle_deg);
    const auto lengths = lengths_mm({box, far}, view);
    // Rays through the boxes' middle have 61 mm in each; seen from the side they stand beside each other.
    const double in_both = angle_deg == 90 ? 61 : 122;
    for (const double length : lengths)
      EXPECT_TRUE(length == 0 || std::abs(length - in_both) < 1e-3) << angle_deg << ' ' << length;
    // Of 61 x 61 pixels each corner and edge is on one side.
    EXPECT_EQ(std::ranges::count_if(lengths, [](double l) { return l > 0; }), 61 * 61) << angle_deg;
  }
}

/// A rod as a pulse sees it that moves so far from each of its thirds to the next.
std::vector<Surface> moving_rod(const glm::dvec3& step_mm, double mu_per_mm = kMu_per_mm) {
  const auto at = [&](double steps) {
    return std::vector{rod(steps * step_mm, {1, 0, 0}, kRadius_mm, mu_per_mm)};
  };
  return seen_by_pulse(at(-1), at(0), at(1), 1);
}

TEST(AbsorbingSurfaces, ARodThatSlidesAlongItselfDuringAPulseIsAsDenseAsAtRest) {
  const View view = view_at(0);
  const auto resting = lengths_mm({rod({0, 0, 0}, {1, 0, 0})}, view),
             sliding = lengths_mm(moving_rod({4, 0, 0}), view);
  for (int j = 0; j < view.height; ++j)
    for (int i = 80 - 50; i <= 80 + 50; ++i) {  // up to where its round ends pass
      const auto at = static_cast<std::size_t>(j * view.width + i);
      // Rounding of transmissions: 1e-7 of them, over mu.
      EXPECT_NEAR(sliding[at], resting[at], 1e-4) << i << " " << j;
    }
}

TEST(AbsorbingSurfaces, WhatMovesDuringAPulseTransmitsTheMeanOfItsPlaces) {
  const View view = view_at(0);
  constexpr double kDense = 10 * kMu_per_mm, kStep_mm = 8;
  // Another surface rests in front of it, and is displaced where it is less dense.
  std::vector<Surface> scene = moving_rod({0, 0, kStep_mm}, kDense);
  scene.push_back(rod({0, 30, 0}, {1, 0, 0}));
  const auto lengths = lengths_mm(scene, view);
  for (int j = 0; j < view.height; ++j) {
    double transmission = 0;
    for (const double z_mm : {-kStep_mm, 0.0, kStep_mm})
      transmission += std::exp(-kDense * chord_mm(j - 80 - z_mm) - kMu_per_mm * chord_mm(j - 80)) / 3;
    const double tau = kMu_per_mm * lengths[static_cast<std::size_t>(j * view.width + 80)];
    // Flat sides of the moving rod, and of the resting one, a tenth as dense.
    EXPECT_NEAR(tau, -std::log(transmission), 1.1 * kDense * kFlatness_mm) << j;
  }
}

TEST(AbsorbingSurfaces, APartOfThePictureIsThatPart) {
  AbsorbingSurfaces absorbing;
  const std::vector surfaces{rod({0, 0, 10}, {1, 0, 0}), rod({5, 0, 0}, {0, 0, 1})};
  absorbing.set(surfaces);
  const View view = view_at(20);
  const auto whole = absorbing.tau(view, {0, 0, view.width, view.height});
  const ScreenBox box = absorbing.box(view), part{30, 50, 70, 40};
  const auto some = absorbing.tau(view, part);
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i) {
      const float expected = whole[static_cast<std::size_t>(j) * view.width + i];
      const bool is_in_box = i >= box.x && j >= box.y && i < box.x + box.width && j < box.y + box.height;
      EXPECT_TRUE(is_in_box || expected == 0) << i << ", " << j;
      if (i < 30 || j < 50 || i >= 100 || j >= 90) continue;
      EXPECT_EQ(some[static_cast<std::size_t>(j - 50) * 70 + (i - 30)], expected) << i << ", " << j;
    }
}

TEST(AbsorbingSurfaces, MovedPointsArePutWhereTheyAre) {
  AbsorbingSurfaces moving, placed;
  moving.set(std::vector{rod({0, 0, 10}, {1, 0, 0}), rod({5, 0, 0}, {0, 0, 1})});
  Surface moved = rod({5, 0, 0}, {0, 0, 1});
  for (glm::vec3& point : moved.mesh.points_mm) point = point * 1.2f + glm::vec3(3, 8, -5);
  moving.move(1, moved.mesh.points_mm);
  placed.set(std::vector{rod({0, 0, 10}, {1, 0, 0}), moved});
  const View view = view_at(20);
  const ScreenBox box = moving.box(view), expected = placed.box(view);
  EXPECT_EQ(std::tuple(box.x, box.y, box.width, box.height),
            std::tuple(expected.x, expected.y, expected.width, expected.height));
  EXPECT_EQ(moving.tau(view, box), placed.tau(view, box));
  EXPECT_THROW(moving.move(1, std::vector<glm::vec3>(3)), InputError);
}

TEST(AbsorbingSurfaces, TrianglesThatLookInwardsAreTurned) {
  Surface turned = rod({0, 0, 0}, {1, 0, 0});
  for (auto& triangle : turned.mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(lengths_mm({turned}, view_at(0))[80 * 161 + 80], 20, 2 * kFlatness_mm);
}

}  // namespace
}  // namespace xraycast::absorbing_surfaces_test
