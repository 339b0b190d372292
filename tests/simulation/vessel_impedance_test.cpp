#include "xraycast/blood_flow/vessel_impedance.hpp"

#include "xraycast/blood_flow/blood.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace xraycast::vessel_impedance_test {
namespace {

constexpr double kPi = std::numbers::pi, kPa_per_mmHg = 133.322387415;

/// A branch along z, with a radius by the place.
VesselTree tube(double length_mm, const std::function<double(double)>& radius_mm) {
  VesselBranch branch;
  constexpr double kStep_mm = 0.25;
  const int steps = static_cast<int>(std::lround(length_mm / kStep_mm));
  for (int i = 0; i <= steps; ++i) {
    const double z_mm = length_mm * i / steps;
    branch.points.push_back({{0, 0, z_mm}, radius_mm(z_mm)});
  }
  return VesselTree({std::move(branch)}, "tube");
}

VesselImpedance impedance(const VesselTree& tree) { return VesselImpedance(tree.branches().front()); }

TEST(VesselImpedance, IsPoiseuillesInAPipe) {
  const VesselTree tree = tube(80, [](double) { return 2.0; });
  const FlowLoss whole = impedance(tree).whole();
  // 8 mu L / (pi r^4) and rho L / (pi r^2) in SI, of a cubic metre; a millilitre is 1e-6 of it.
  const double resistance = 8 * 3.5e-3 * 0.08 / (kPi * std::pow(2e-3, 4)) * 1e-6 / kPa_per_mmHg;
  const double inertance = 1060 * 0.08 / (kPi * std::pow(2e-3, 2)) * 1e-6 / kPa_per_mmHg;
  EXPECT_NEAR(whole.resistance, resistance, 1e-9 * resistance);
  EXPECT_NEAR(whole.inertance, inertance, 1e-9 * inertance);
  EXPECT_EQ(whole.quadratic_loss, 0);
  EXPECT_NEAR(impedance(tree).up_to(20.1).resistance, resistance * 20.1 / 80, 1e-9 * resistance);
}

TEST(VesselImpedance, OfATaperIsItsIntegral) {
  const VesselTree tree = tube(60, [](double z_mm) { return 3 - z_mm / 30; });
  // The integral of dl / r^4 with dr/dl = -1/30: 10 (1/1^3 - 1/3^3), and of dl / r^2: 30 (1/1 - 1/3).
  const FlowLoss pipe = impedance(tube(1, [](double) { return 1.0; })).whole(),
                 whole = impedance(tree).whole();
  EXPECT_NEAR(whole.resistance, pipe.resistance * 10 * (1 - 1.0 / 27), 1e-9 * whole.resistance);
  EXPECT_NEAR(whole.inertance, pipe.inertance * 20, 1e-9 * whole.inertance);
  EXPECT_EQ(whole.quadratic_loss, 0) << "it narrows, but does not widen again";
}

/// 6 mm wide and 10 mm of it narrowed to a share of the area, between steep shoulders.
VesselTree stenosed(double share_of_area, double shoulder_mm = 0.25) {
  return tube(60, [=](double z_mm) {
    const double outside_mm = std::max(std::abs(z_mm - 30) - 5, 0.0);
    return std::lerp(3 * std::sqrt(share_of_area), 3.0, std::min(1.0, outside_mm / shoulder_mm));
  });
}

TEST(VesselImpedance, OfAStenosisHasThePressureDropOfYoungAndTsai) {
  for (const double narrowed : {0.5, 0.75, 0.9})
    for (const double flow_ml_s : {1.0, 5.0, 12.0}) {
      const VesselTree tree = stenosed(1 - narrowed);
      const FlowLoss loss = impedance(tree).whole();
      const double outside = impedance(tube(50, [](double) { return 3.0; })).whole().resistance;
      const double drop_mmHg =
          (loss.resistance - outside) * flow_ml_s + loss.quadratic_loss * flow_ml_s * flow_ml_s;
      // Their formula in SI: mu U / D Kv + rho U^2 / 2 Kt (A0 / A1 - 1)^2, with Kv = 32 La / D (A0 / A1)^2.
      const double d = 6e-3, narrow_d = d * std::sqrt(1 - narrowed),
                   velocity = flow_ml_s * 1e-6 / (kPi * d * d / 4);
      const double ratio = 1 / (1 - narrowed), length = 0.83 * 0.01 + 1.64 * narrow_d;
      const double viscous = 32 * length / d * ratio * ratio * 3.5e-3 * velocity / d;
      const double turbulent = 1.52 * 1060 / 2 * velocity * velocity * (ratio - 1) * (ratio - 1);
      // The bar is 10 %, of which the shoulders take 1 or 2.
      EXPECT_NEAR(drop_mmHg * kPa_per_mmHg / (viscous + turbulent), 1, 0.05) << narrowed << " " << flow_ml_s;
    }
}

TEST(VesselImpedance, HasItsLossAtTheThroat) {
  const VesselTree tree = stenosed(0.25, 5);
  const VesselImpedance vessel = impedance(tree);
  EXPECT_EQ(vessel.up_to(20).quadratic_loss, 0);
  EXPECT_EQ(vessel.up_to(40).quadratic_loss, vessel.whole().quadratic_loss);
  EXPECT_GT(vessel.whole().quadratic_loss, 0);
}

TEST(VesselImpedance, CountsLittleOfUnevenWalls) {
  // Radii as a segmentation has them: up to 5 % off.
  const VesselTree tree = tube(60, [](double z_mm) { return 3 * (1 + 0.05 * std::sin(2 * z_mm)); });
  const FlowLoss loss = impedance(tree).whole(),
                 even = impedance(tube(60, [](double) { return 3.0; })).whole();
  constexpr double kFlow_ml_s = 5;
  // The mean of 1 / r^4 is 1.3 % above.
  EXPECT_NEAR((loss.resistance + loss.quadratic_loss * kFlow_ml_s) / even.resistance, 1, 0.015);
}

TEST(HealthyRadii, BridgeWhatIsNarrowerThanBothSides) {
  const VesselTree tree = stenosed(0.25, 5);
  for (const double radius_mm : healthy_radii_mm(tree.branches().front())) EXPECT_EQ(radius_mm, 3);
  const VesselTree taper = tube(60, [](double z_mm) { return 3 - z_mm / 30; });
  const std::vector<double> radii_mm = healthy_radii_mm(taper.branches().front());
  for (std::size_t i = 0; i < radii_mm.size(); ++i)
    EXPECT_EQ(radii_mm[i], taper.branches().front().points[i].radius_mm);
}

TEST(VesselImpedance, OfAnAnnulusIsThatOfTwoCylinders) {
  const VesselTree tree = tube(60, [](double) { return 3.0; });
  VesselImpedance vessel = impedance(tree);
  const FlowLoss empty = vessel.whole();
  vessel.occupy(0, 30, 0.85);
  const double k = 0.85 / 3;
  const double share = 1 - std::pow(k, 4) + std::pow(1 - k * k, 2) / std::log(k);
  EXPECT_NEAR(vessel.whole().resistance, 0.5 * empty.resistance * (1 + 1 / share), 1e-9);
  EXPECT_NEAR(vessel.whole().inertance, 0.5 * empty.inertance * (1 + 1 / (1 - k * k)), 1e-9);
  EXPECT_EQ(vessel.whole().blocked, 0);
  vessel.empty();
  EXPECT_EQ(vessel.whole().resistance, empty.resistance);
  vessel.occupy(0, 30, 3);
  EXPECT_GT(vessel.up_to(15).blocked, 0);
  EXPECT_EQ(vessel.whole().blocked, vessel.up_to(30).blocked);
}

}  // namespace
}  // namespace xraycast::vessel_impedance_test
