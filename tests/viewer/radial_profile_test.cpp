#include "xraycast/sampling/radial_profile.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast::radial_profile_test {
namespace {

// The system is solved in 32-bit floats, and amplifies rounding by its condition, which is below 2.
constexpr double kFloat = 1e-6;
const std::vector<double> kRadii{0, 30, 42, 52, 60, 75};

/// mu at a radius, as it is drawn.
double mu_at(const RadialProfile& profile, const std::vector<float>& mu, double radius_mm) {
  const auto place = profile.at(radius_mm);
  const auto next = std::min<std::size_t>(place.layer + 1, mu.size() - 1);
  return mu[place.layer] * (1 - place.fraction) + mu[next] * place.fraction;
}

/// The same for one texel.
void solve(const RadialProfile& profile, std::vector<float>& values, double reach_mm = kRadii.back()) {
  profile.system(std::array{reach_mm}).solve(values, 1);
}

TEST(RadialProfile, KeepsEveryShellsOpticalDepth) {
  const std::vector<float> tau{0.3f, 0.9f, 0.01f, 0.5f, 0.0f};
  const RadialProfile profile(kRadii, Reconstruction::linear);
  std::vector<float> mu = tau;
  solve(profile, mu);
  for (std::size_t k = 0; k < tau.size(); ++k) {
    // Midpoints of 3000 steps integrate a function that bends once to 1e-7 of the shell.
    constexpr int kSteps = 3000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
      sum += mu_at(profile, mu, kRadii[k] + (i + 0.5) / kSteps * (kRadii[k + 1] - kRadii[k]));
    EXPECT_NEAR(sum / kSteps * (kRadii[k + 1] - kRadii[k]), tau[k], 3 * kFloat) << k;
  }
}

TEST(RadialProfile, ReproducesWhatIsConstant) {
  std::vector<float> mu;
  for (std::size_t k = 0; k + 1 < kRadii.size(); ++k)
    mu.push_back(static_cast<float>(0.02 * (kRadii[k + 1] - kRadii[k])));
  solve(RadialProfile(kRadii, Reconstruction::linear), mu);
  EXPECT_THAT(mu, ::testing::Each(::testing::FloatNear(0.02f, static_cast<float>(kFloat))));
}

TEST(RadialProfile, SolvesTexelsSideBySide) {
  std::vector<float> two{0.3f, 1, 0.9f, 2, 0.01f, 3, 0.5f, 4, 0, 5}, one{0.3f, 0.9f, 0.01f, 0.5f, 0};
  const RadialProfile profile(kRadii, Reconstruction::linear);
  profile.system(std::array{kRadii.back(), kRadii.back()}).solve(two, 2);
  solve(profile, one);
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_FLOAT_EQ(two[2 * k], one[k]);
}

TEST(RadialProfile, ConstantShellsAreTheirMeans) {
  std::vector<float> mu{0.3f, 0.24f, 0.1f, 0, 0.15f};
  const RadialProfile profile(kRadii, Reconstruction::constant);
  solve(profile, mu);
  EXPECT_THAT(mu, ::testing::Pointwise(::testing::FloatEq(), {0.01f, 0.02f, 0.01f, 0.0f, 0.01f}));
  EXPECT_EQ(profile.at(29.9).layer, 0);
  EXPECT_EQ(profile.at(30.1).layer, 1);
  EXPECT_EQ(profile.at(75).layer, 4);
  EXPECT_EQ(profile.at(75).fraction, 0);
}

TEST(RadialProfile, KeepsTheSumsOfARayThatEndsBeforeTheLastEdge) {
  // Before a shell's middle, in it, after it, at an edge, within the first shell and before it.
  for (const double reach : {48.0, 47.0, 50.0, 42.0, 12.0, 0.0})
    for (const Reconstruction reconstruction : {Reconstruction::linear, Reconstruction::constant}) {
      const RadialProfile profile(kRadii, reconstruction);
      std::vector<float> tau, mu;
      for (std::size_t k = 0; k + 1 < kRadii.size(); ++k)
        tau.push_back(static_cast<float>(0.01 * static_cast<double>(k + 1) *
                                         std::max(0.0, std::min(reach, kRadii[k + 1]) - kRadii[k])));
      mu = tau;
      solve(profile, mu, reach);
      for (std::size_t k = 0; k < tau.size(); ++k) {
        const double outer = std::min(kRadii[k + 1], reach);
        // As above.
        constexpr int kSteps = 3000;
        double sum = 0;
        for (int i = 0; i < kSteps; ++i)
          sum += mu_at(profile, mu, kRadii[k] + (i + 0.5) / kSteps * (outer - kRadii[k]));
        if (outer > kRadii[k])
          EXPECT_NEAR(sum / kSteps * (outer - kRadii[k]), tau[k], 3 * kFloat) << reach << ' ' << k;
        else if (k > 0)
          EXPECT_EQ(mu[k], mu[k - 1]) << reach << ' ' << k;
        else
          EXPECT_EQ(mu[k], 0);
      }
    }
}

TEST(RadialProfile, OfWhatIsConstantUpToWhereTheRayEndsIsConstant) {
  std::vector<float> mu;
  for (std::size_t k = 0; k + 1 < kRadii.size(); ++k)
    mu.push_back(static_cast<float>(0.02 * std::max(0.0, std::min(44.0, kRadii[k + 1]) - kRadii[k])));
  solve(RadialProfile(kRadii, Reconstruction::linear), mu, 44);
  EXPECT_THAT(mu, ::testing::Each(::testing::FloatNear(0.02f, static_cast<float>(kFloat))));
}

TEST(RadialProfile, PlacesRadiiBetweenTheMiddlesOfShells) {
  const RadialProfile profile(kRadii, Reconstruction::linear);
  EXPECT_EQ(profile.at(3).layer, 0);
  EXPECT_EQ(profile.at(3).fraction, 0);
  EXPECT_EQ(profile.at(41.5).layer, 1);  // middles at 15, 36, 47
  EXPECT_DOUBLE_EQ(profile.at(41.5).fraction, 0.5);
  EXPECT_EQ(profile.at(75).layer, 3);
  EXPECT_EQ(profile.at(75).fraction, 1);
  EXPECT_EQ(RadialProfile(std::vector<double>{0, 10}, Reconstruction::linear).at(7).layer, 0);
}

}  // namespace
}  // namespace xraycast::radial_profile_test
