#include "xraycast/simulation/contrast_bolus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast::test::contrast_bolus_test {
namespace {

VesselBranch straight(glm::dvec3 from_mm, glm::dvec3 to_mm, double radius_mm, int parent) {
  VesselBranch branch;
  branch.parent = parent;
  constexpr int kStretches = 100;
  for (int i = 0; i <= kStretches; ++i)
    branch.points.push_back({from_mm + (to_mm - from_mm) * (static_cast<double>(i) / kStretches), radius_mm});
  return branch;
}

/// 100 mm of vessel that divide into two of different width, of which the wider divides once more.
VesselTree tree() {
  return VesselTree(
      {straight({0, 0, 0}, {0, 0, -100}, 4, -1), straight({0, 0, -100}, {40, 0, -150}, 3, 0),
       straight({0, 0, -100}, {-40, 0, -150}, 2, 0), straight({40, 0, -150}, {60, 0, -200}, 2, 1),
       straight({40, 0, -150}, {20, 0, -200}, 2, 1)},
      "test");
}

constexpr double kRootFlow_ml_s = 170 * std::numbers::pi * 4 * 4 / 1000;

class Bolus : public testing::Test {
 protected:
  VesselTree::Location tip(int branch, double arc_length_mm) const {
    VesselTree::Location location;
    location.branch = branch;
    location.arc_length_mm = arc_length_mm;
    return location;
  }
  /// In the whole tree, whose segments are cylinders.
  double iodine_mg() const {
    double sum_mg = 0;
    for (std::size_t b = 0; b < tree_.branches().size(); ++b) {
      const VesselBranch& branch = tree_.branches()[b];
      const std::vector<double>& iodine_mg_ml = bolus_.iodine_mg_ml()[b];
      const double radius_mm = branch.points.front().radius_mm;
      const double segment_mm = branch.arc_length_mm.back() / static_cast<double>(iodine_mg_ml.size());
      const double segment_ml = 1e-3 * std::numbers::pi * radius_mm * radius_mm * segment_mm;
      for (const double mg_ml : iodine_mg_ml) sum_mg += mg_ml * segment_ml;
    }
    return sum_mg;
  }
  const VesselTree tree_ = tree();
  ContrastBolus bolus_{tree_};
};

TEST_F(Bolus, KeepsItsIodine) {
  for (int i = 0; i < 300; ++i) bolus_.step(0.033, tip(0, 30), i < 60 ? 5 : 0);
  const double injected_mg = 60 * 0.033 * 5 * 350;
  // Sums of a thousand terms in double precision.
  EXPECT_NEAR(iodine_mg() + bolus_.washed_out_mg(), injected_mg, 1e-9 * injected_mg);
  EXPECT_LT(iodine_mg(), 0.01 * injected_mg) << "washes out";
}

TEST_F(Bolus, IsDilutedByTheBloodThatPasses) {
  for (int i = 0; i < 300; ++i) bolus_.step(0.033, tip(0, 30), 5);
  const double expected_mg_ml = 350 * 5 / (5 + kRootFlow_ml_s);
  for (const int branch : {1, 2, 3, 4})
    // Ten seconds are a tenth of a per mille from the steady state.
    EXPECT_NEAR(bolus_.iodine_mg_ml()[static_cast<std::size_t>(branch)].back(), expected_mg_ml,
                1e-3 * expected_mg_ml);
}

TEST_F(Bolus, DoesNotGoUpstreamOrIntoOtherBranches) {
  for (int i = 0; i < 100; ++i) bolus_.step(0.033, tip(1, 20), 5);
  const auto most = [&](int branch) {
    return std::ranges::max(bolus_.iodine_mg_ml()[static_cast<std::size_t>(branch)]);
  };
  EXPECT_EQ(most(0), 0);
  EXPECT_EQ(most(2), 0);
  EXPECT_EQ(bolus_.iodine_mg_ml()[1].front(), 0);
  EXPECT_GT(most(3), 50);
  EXPECT_GT(most(4), 50);
}

/// When a trace, which adds no flow, reaches half of what it is in the end, in the last stretch of a branch.
double arrival_s(ContrastBolus& bolus, const VesselTree::Location& tip, std::size_t branch) {
  const double plateau_mg_ml = 350 * 1e-6 / kRootFlow_ml_s;
  double time_s = 0;
  for (; bolus.iodine_mg_ml()[branch].back() < 0.5 * plateau_mg_ml && time_s < 2; time_s += 0.002)
    bolus.step(0.002, tip, 1e-6);
  return time_s;
}

// The median of a front that has spread comes a little before its mean.
constexpr double kArrival_s = 0.01;

TEST_F(Bolus, ArrivesWhenTheBloodDoes) {
  EXPECT_NEAR(arrival_s(bolus_, tip(0, 30), 0), 70.0 / 170, kArrival_s);
}

TEST_F(Bolus, IsAsFastInNarrowBranchesAsInWideOnes) {
  const double velocity_mm_s = 170.0 * (4 * 4) / (3 * 3 + 2 * 2),
               expected_s = 70.0 / 170 + std::hypot(40, 50) / velocity_mm_s;
  for (const std::size_t branch : {1, 2}) {
    ContrastBolus bolus(tree_);
    EXPECT_NEAR(arrival_s(bolus, tip(0, 30), branch), expected_s, kArrival_s) << branch;
  }
}

}  // namespace
}  // namespace xraycast::test::contrast_bolus_test
