#include "xraycast/mechanics/friction.hpp"

#include <gtest/gtest.h>

namespace xraycast::friction_test {
namespace {

using Eigen::Vector2d;

constexpr Friction kFriction{.spring_mN_mm = 50, .limit_mN = 10};
// It slips from a displacement of 0.2 mm on.
const Vector2d kSticks{0.03, -0.04}, kSlips{0.3, -0.4};

TEST(Friction, DerivativesAreLimitsOfDifferences) {
  constexpr double kStep_mm = 1e-4;
  for (const Vector2d& at : {kSticks, kSlips}) {
    const Friction::Derivatives exact = kFriction.derivatives(at);
    for (int c = 0; c < 2; ++c) {
      const Vector2d step = kStep_mm * Vector2d::Unit(c);
      const double slope = (kFriction.energy_uJ(at + step) - kFriction.energy_uJ(at - step)) / (2 * kStep_mm);
      const Vector2d column =
          (kFriction.derivatives(at + step).gradient_mN - kFriction.derivatives(at - step).gradient_mN) /
          (2 * kStep_mm);
      // The square of the step over the displacement, times some ten mN and mN/mm.
      EXPECT_NEAR(slope, exact.gradient_mN[c], 1e-5);
      EXPECT_LT((column - exact.hessian_mN_mm.col(c)).norm(), 1e-5);
    }
  }
}

TEST(Friction, EnergyAndForceAreContinuousWhereItBeginsToSlip) {
  const Vector2d before{0.2 - 1e-9, 0}, after{0.2 + 1e-9, 0};
  // A spring of 50 mN/mm over 2e-9 mm.
  EXPECT_NEAR(kFriction.energy_uJ(before), kFriction.energy_uJ(after), 1e-7);
  EXPECT_NEAR(kFriction.derivatives(before).gradient_mN.x(), kFriction.derivatives(after).gradient_mN.x(),
              2e-7);
}

TEST(Friction, ReturnsToTheConeAndBeyondItToTheKineticOne) {
  const Friction::Returned stuck = kFriction.return_map(kSticks, 0.8);
  EXPECT_FALSE(stuck.slips);
  EXPECT_EQ(stuck.displacement_mm, kSticks);
  EXPECT_EQ(stuck.force_mN, -50 * kSticks);
  const Friction::Returned slipping = kFriction.return_map(kSlips, 0.8);
  EXPECT_TRUE(slipping.slips);
  // The limit over the spring is 0.2 mm; rounding of a few products.
  EXPECT_NEAR(slipping.force_mN.norm(), 10, 1e-12);
  EXPECT_NEAR(slipping.displacement_mm.norm(), 0.8 * 0.2, 1e-12);
  EXPECT_LT(slipping.force_mN.dot(kSlips), 0) << "against the displacement";
}

}  // namespace
}  // namespace xraycast::friction_test
