#include "xraycast/contrast_agent/laminar_vessel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace xraycast::laminar_vessel_test {
namespace {

constexpr double kParabola = 2, kPlug = 1e9;

/// A tube along x, in segments of a millimetre.
class Tube {
 public:
  Tube(double length_mm, double radius_mm, double velocity_mm_s, double profile_exponent,
       double diffusivity_mm2_s = 0)
      : area_mm2_(std::numbers::pi * radius_mm * radius_mm),
        velocity_mm_s_(velocity_mm_s),
        tree_({branch(length_mm, radius_mm)}, "tube"),
        vessel_(tree_.branches().front(), profile_exponent, diffusivity_mm2_s, 0) {
    vessel_.set_flow(1e-3 * area_mm2_ * velocity_mm_s, nullptr);
  }

  /// Lets blood with a concentration by the time of a step enter.
  void flow(double time_s, const std::function<double(double)>& mg_ml) {
    const double steps = std::ceil(time_s / vessel_.longest_step_s(std::abs(vessel_.end_ml_s())));
    for (double i = 0; i < steps; ++i) {
      time_s_ += time_s / steps;
      left_mg_ += vessel_.leaving_end_mg(time_s / steps);
      vessel_.advect(time_s / steps, mg_ml(time_s_), 0);
      vessel_.diffuse(time_s / steps);
    }
  }

  std::vector<double> mg_ml() const {
    std::vector<double> means;
    vessel_.copy_means(means);
    return means;
  }

  /// Where a front of 1 mg/ml has a half, between the middles of two segments.
  double middle_mm() const {
    const std::vector<double> c = mg_ml();
    std::size_t i = 1;
    while (i + 1 < c.size() && c[i] > 0.5) ++i;
    return static_cast<double>(i) - 0.5 + (c[i - 1] - 0.5) / (c[i - 1] - c[i]);
  }

  struct Spread {
    double mg, mean_mm, variance_mm2;
  };
  Spread spread() const {
    const std::vector<double> c = mg_ml();
    double sum = 0, first = 0, second = 0;
    for (std::size_t i = 0; i < c.size(); ++i) {
      const double x_mm = static_cast<double>(i) + 0.5;
      sum += c[i], first += c[i] * x_mm, second += c[i] * x_mm * x_mm;
    }
    return {1e-3 * area_mm2_ * sum, first / sum, second / sum - first / sum * first / sum};
  }

  double left_mg() const { return left_mg_; }
  LaminarVessel& vessel() { return vessel_; }

 private:
  static VesselBranch branch(double length_mm, double radius_mm) {
    VesselBranch branch;
    for (int i = 0; i <= static_cast<int>(length_mm); ++i) branch.points.push_back({{i, 0, 0}, radius_mm});
    return branch;
  }
  double area_mm2_, velocity_mm_s_;
  VesselTree tree_;
  LaminarVessel vessel_;
  double time_s_ = 0, left_mg_ = 0;
};

double always(double) { return 1; }
double bolus_of_a_tenth(double time_s) { return time_s <= 0.1 ? 1 : 0; }

TEST(LaminarVessel, AdvectsAPlugWithLittleDispersionOfItsOwn) {
  Tube tube(800, 2, 200, kPlug);
  tube.flow(0.2, bolus_of_a_tenth);
  const Tube::Spread before = tube.spread();
  tube.flow(3, bolus_of_a_tenth);
  const Tube::Spread after = tube.spread();
  // 200 mm/s times 3 s, to a tenth of a cell.
  EXPECT_NEAR(after.mean_mm - before.mean_mm, 600, 0.2);
  EXPECT_NEAR(after.mg, before.mg, 1e-12);
  // In 600 mm the flattest profile of an artery (n = 9) spreads a bolus by 600 mm / sqrt(9 + 1) = 190 mm; the
  // scheme must add less than a fiftieth of that variance. First order upwind adds 1200 mm2 a metre.
  EXPECT_LT(after.variance_mm2 - before.variance_mm2, 0.02 * 600 * 600 / 10);
  EXPECT_LT(after.variance_mm2 - before.variance_mm2, 60) << "less than a cell's length squared each 40 mm";
}

TEST(LaminarVessel, FrontsArriveWhenAdvectionSays) {
  for (const double n : {kParabola, kPlug})
    for (const double time_s : {0.5, 1.0, 2.0}) {
      Tube tube(1000, 3, 150, n);
      tube.flow(time_s, always);
      // The section's mean is a half where the mean velocity is. The bar is 5 %; a cell is 2 mm.
      EXPECT_NEAR(tube.middle_mm(), 150 * time_s, 0.01 * 150 * time_s + 2) << n << ", " << time_s;
    }
}

TEST(LaminarVessel, AFrontOfAParabolaFallsLinearly) {
  Tube tube(500, 3, 150, kParabola);
  tube.flow(1, always);
  const std::vector<double> c = tube.mg_ml();
  for (std::size_t i = 0; i < 300; ++i)
    // Taylor's solution without diffusion; there are nine laminae.
    EXPECT_NEAR(c[i], 1 - (static_cast<double>(i) + 0.5) / (2 * 150), 0.5 / 9 + 0.01) << i;
  for (std::size_t i = 310; i < c.size(); ++i) EXPECT_LT(c[i], 1e-3) << "nothing is faster than the axis";
}

TEST(LaminarVessel, DispersesAsTaylorFoundOnceDiffusionHasMixedTheSection) {
  constexpr double kRadius_mm = 1, kVelocity_mm_s = 10, kDiffusivity_mm2_s = 0.05;
  // After R^2 / (14.4 D) = 1.4 s; at 20 s it holds.
  Tube tube(1000, kRadius_mm, kVelocity_mm_s, kParabola, kDiffusivity_mm2_s);
  const auto bolus = [](double time_s) { return time_s <= 1 ? 1.0 : 0.0; };
  tube.flow(20, bolus);
  const Tube::Spread before = tube.spread();
  tube.flow(20, bolus);
  const Tube::Spread after = tube.spread();
  const double taylor_mm2_s = std::pow(kVelocity_mm_s * kRadius_mm, 2) / (48 * kDiffusivity_mm2_s);
  // Nine laminae have 1 - 1/81 of a parabola's variance of velocities.
  EXPECT_NEAR((after.variance_mm2 - before.variance_mm2) / (2 * 20), taylor_mm2_s, 0.05 * taylor_mm2_s);
  EXPECT_NEAR((after.mean_mm - before.mean_mm) / 20, kVelocity_mm_s, 0.01 * kVelocity_mm_s);
}

TEST(LaminarVessel, SpreadsByShearAloneBeforeThat) {
  Tube tube(1500, 3, 150, kParabola);
  tube.flow(3, bolus_of_a_tenth);
  // What enters is distributed as the flow is: the velocity is 4/3 of the mean's with a variance of 2/9 of
  // its square. The bolus is 15 mm long, and nine laminae lack a per cent or two.
  EXPECT_NEAR(tube.spread().mean_mm, 4.0 / 3 * 150 * 2.95, 0.02 * 150 * 4);
  EXPECT_NEAR(std::sqrt(tube.spread().variance_mm2), std::sqrt(2.0 / 9) * 150 * 2.95, 0.03 * 150 * 1.4);
}

TEST(LaminarVessel, LosesNothingAndMakesNoNewExtremes) {
  Tube tube(300, 2, 200, 5, 3e-4);
  tube.flow(1, always);
  for (const double c : tube.mg_ml()) {
    EXPECT_GE(c, 0);
    EXPECT_LE(c, 1 + 1e-12);
  }
  const double entered_mg = 1e-3 * std::numbers::pi * 4 * 200;
  EXPECT_NEAR(tube.vessel().in_vessel_mg() + tube.left_mg(), entered_mg, 1e-12 * entered_mg);
  tube.flow(20, [](double) { return 0; });
  const double dropped_mg = tube.vessel().drop_traces_mg();
  EXPECT_NEAR(tube.vessel().in_vessel_mg() + tube.left_mg() + dropped_mg, entered_mg, 1e-11 * entered_mg);
}

TEST(LaminarVessel, FlowsBackAsItFlowedForth) {
  Tube tube(400, 2, 200, kPlug);
  tube.flow(1, bolus_of_a_tenth);
  const Tube::Spread before = tube.spread();
  tube.vessel().set_flow(-tube.vessel().end_ml_s(), nullptr);
  tube.flow(0.5, bolus_of_a_tenth);
  EXPECT_NEAR(tube.spread().mean_mm, before.mean_mm - 100, 0.2);
  EXPECT_NEAR(tube.spread().mg, before.mg, 1e-12);
}

}  // namespace
}  // namespace xraycast::laminar_vessel_test
