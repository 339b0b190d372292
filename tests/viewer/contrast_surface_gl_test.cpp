#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/motion/moving_points.hpp"
#include "xraycast/scene/contrast_surface.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace xraycast::contrast_surface_gl_test {
namespace {

constexpr double kRadius_mm = 5, kMu_per_mm = 0.001;

/// 100 mm along x, a stretch a millimetre.
VesselTree straight() {
  VesselBranch branch;
  for (int i = 0; i <= 100; ++i) branch.points.push_back({{i - 50, 0, 0}, kRadius_mm});
  return VesselTree({branch}, "test");
}

View view_at(double angle_deg) {
  return {.lao_rad = angle_deg * std::numbers::pi / 180, .width = 121, .height = 31, .pixel_mm = 1};
}

class ContrastPicture : public testing::Test {
 protected:
  /// Optical depths of the picture's middle row.
  std::vector<float> middle_row(const View& view, const std::vector<double>& iodine_mg_ml) {
    renderer_.replace_surface(0, ContrastSurface(tree_, kMu_per_mm).filled({iodine_mg_ml}));
    const std::vector<float> tau = renderer_.tau(view, {});
    const auto row = tau.begin() + static_cast<std::ptrdiff_t>(view.height / 2) * view.width;
    return {row, row + view.width};
  }

  HeadlessContext context_;
  const VesselTree tree_ = straight();
  Renderer renderer_;
};

// Twelve sides across a circle are at most 1 - cos(pi/12) = 3.4 % narrower than it.
constexpr double kFlatness = 0.035;

TEST_F(ContrastPicture, IsThicknessTimesConcentration) {
  std::vector<double> iodine_mg_ml;
  for (int i = 0; i < 100; ++i) iodine_mg_ml.push_back(i);
  const auto tau = middle_row(view_at(0), iodine_mg_ml);
  for (int x = -40; x <= 40; ++x) {
    const double expected = kMu_per_mm * 2 * kRadius_mm * (50 + x);
    // A drum of two stretches has their mean, and a ray along the face between two drums meets either.
    EXPECT_NEAR(tau[static_cast<std::size_t>(60 + x)], expected, kFlatness * expected + 0.015) << x;
  }
}

TEST_F(ContrastPicture, MovesWithTheBody) {
  // The left half filled, in a body that has moved by 12 mm to the left where its breath is at 1.
  std::vector<double> iodine_mg_ml(100, 0.0);
  std::fill(iodine_mg_ml.begin() + 50, iodine_mg_ml.end(), 80.0);
  const ContrastSurface contrast(tree_, kMu_per_mm);
  const Motion motion(
      {{"breath", 4, {}, {{0, nullptr}, {1, affine_displacement(glm::dmat3(1), {-12, 0, 0})}}}},
      "motion.json");
  Progress progress;
  const MovingPoints moving(contrast.whole().mesh.points_mm, motion, progress);
  const std::vector phases{1.0};
  const Surface moved = contrast.filled({iodine_mg_ml}, moving.at(phases)),
                rest = contrast.filled({iodine_mg_ml});
  EXPECT_EQ(moved.mesh.triangles, rest.mesh.triangles);
  EXPECT_EQ(moved.mu_weights, rest.mu_weights);
  ASSERT_EQ(moved.mesh.points_mm.size(), rest.mesh.points_mm.size());
  for (std::size_t i = 0; i < rest.mesh.points_mm.size(); ++i)
    EXPECT_LT(glm::distance(moved.mesh.points_mm[i], rest.mesh.points_mm[i] + glm::vec3(12, 0, 0)), 0.01)
        << i;
  renderer_.replace_surface(0, moved);
  const std::vector<float> tau = renderer_.tau(view_at(0), {});
  const auto* row = &tau[std::size_t{15} * 121];
  EXPECT_EQ(row[60 + 8], 0);
  EXPECT_NEAR(row[60 + 30], kMu_per_mm * 2 * kRadius_mm * 80, kFlatness * 0.8);
}

TEST_F(ContrastPicture, IsNowhereWhereThereIsNoIodine) {
  std::vector<double> iodine_mg_ml(100, 0.0);
  std::fill(iodine_mg_ml.begin() + 40, iodine_mg_ml.begin() + 60, 100.0);
  const auto tau = middle_row(view_at(0), iodine_mg_ml);
  EXPECT_EQ(tau[40], 0);
  EXPECT_EQ(tau[80], 0);
  EXPECT_NEAR(tau[60], kMu_per_mm * 100 * 2 * kRadius_mm, kFlatness);
}

TEST_F(ContrastPicture, IsWholeWhereAWideVesselBeginsWithAKink) {
  // As trees do at branchings: the first points step 1.2 mm aside, across a vessel of 19 mm.
  VesselBranch branch;
  for (const double x : {0.0, 0.15, 0.5, 1.0}) branch.points.push_back({{x, 0, 1.2 * (1 - x)}, 9.6});
  for (int i = 0; i <= 60; ++i) branch.points.push_back({{1.5 + 0.5 * i, 0, 0}, 9.6});
  const std::vector<double> iodine_mg_ml(branch.points.size() - 1, 100.0);
  renderer_.replace_surface(
      0, ContrastSurface(VesselTree({branch}, "kinked"), kMu_per_mm).filled({iodine_mg_ml}));
  const View view{.centre_mm = {10, 0, 0}, .width = 11, .height = 15, .pixel_mm = 1};
  const std::vector<float> tau = renderer_.tau(view, {});
  for (int row = 0; row < view.height; ++row) {
    const double z_mm = 7 - row, expected = kMu_per_mm * 100 * 2 * std::sqrt(9.6 * 9.6 - z_mm * z_mm);
    for (int x = 0; x < view.width; ++x)
      // Twelve sides, and where drums of different directions meet, a ray passes a wedge of 1.5 mm at most.
      EXPECT_NEAR(tau[static_cast<std::size_t>(row * view.width + x)], expected, 0.15 * expected)
          << x << " " << z_mm;
  }
}

TEST_F(ContrastPicture, AddsUpAlongItsLength) {
  // Seen along the vessel: 20 mm of 100 and 30 mm of 50 mg/ml.
  std::vector<double> iodine_mg_ml(100, 0.0);
  std::fill(iodine_mg_ml.begin() + 10, iodine_mg_ml.begin() + 30, 100.0);
  std::fill(iodine_mg_ml.begin() + 30, iodine_mg_ml.begin() + 60, 50.0);
  const auto tau = middle_row(view_at(90), iodine_mg_ml);
  // Sums of 32-bit floats, of some 50 faces.
  EXPECT_NEAR(tau[60], kMu_per_mm * (20 * 100 + 30 * 50), 1e-4);
}

}  // namespace
}  // namespace xraycast::contrast_surface_gl_test
