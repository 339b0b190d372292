#include "xraycast/contrast_agent/contrast_bolus.hpp"

#include "straight_vessels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast::test::contrast_bolus_test {
namespace {

/// 100 mm of vessel that divide into two of different width, of which the wider divides once more.
VesselTree tree() {
  return VesselTree(
      {straight({0, 0, 0}, {0, 0, -100}, 4, -1), straight({0, 0, -100}, {40, 0, -150}, 3, 0),
       straight({0, 0, -100}, {-40, 0, -150}, 2, 0), straight({40, 0, -150}, {60, 0, -200}, 2, 1),
       straight({40, 0, -150}, {20, 0, -200}, 2, 1)},
      "test");
}

constexpr double kRootFlow_ml_s = 170 * std::numbers::pi * 4 * 4 / 1000;

/// A tree by the toss of dice: it forks as Murray's law says, bends, and has branches as short as they come.
VesselTree grown(std::uint32_t seed) {
  std::mt19937 dice(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(dice()) / 4294967296.0;
  };
  std::vector<VesselBranch> branches{straight({0, 0, 0}, {0, 0, -uniform(20, 80)}, uniform(2, 8), -1)};
  for (std::size_t parent = 0; branches.size() < 40; ++parent) {
    const VesselPoint end = branches[parent].points.back();
    const double share = uniform(0.2, 0.8);  // of the flow
    for (const double of_it : {share, 1 - share}) {
      const double length_mm = std::exp(uniform(std::log(0.2), std::log(60)));
      const glm::dvec3 way{uniform(-1, 1), uniform(-1, 1), uniform(-2, -0.1)};
      branches.push_back(straight(end.position_mm, end.position_mm + length_mm * way,
                                  end.radius_mm * std::cbrt(of_it), static_cast<int>(parent)));
    }
  }
  return VesselTree(std::move(branches), "grown");
}

constexpr double kSteady_bpm = 0;

class Bolus : public testing::Test {
 protected:
  VesselTree::Location tip(int branch, double arc_length_mm) const { return place(branch, arc_length_mm); }
  double most(int branch) const {
    return std::ranges::max(bolus_.iodine_mg_ml()[static_cast<std::size_t>(branch)]);
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
  for (int i = 0; i < 600; ++i) {
    bolus_.step(0.033, tip(0, 30), i < 60 ? 5 : 0);
    const double injected_mg = std::min(i + 1, 60) * 0.033 * 5 * 350;
    // Sums of some ten thousand terms in double precision.
    ASSERT_NEAR(bolus_.in_tree_mg() + bolus_.washed_out_mg(), injected_mg, 1e-9 * injected_mg);
    ASSERT_NEAR(iodine_mg(), bolus_.in_tree_mg(), 1e-9 * injected_mg) << "as it is drawn";
  }
  EXPECT_LT(iodine_mg(), 0.01 * bolus_.washed_out_mg()) << "washes out";
}

TEST_F(Bolus, IsDilutedByTheBloodThatPasses) {
  ContrastBolus bolus(tree_, {.heart_rate_bpm = kSteady_bpm});
  for (int i = 0; i < 1000; ++i) bolus.step(0.033, tip(0, 30), 5);
  // The heart goes on with its 83 ml/s, so that the whole body has 5 ml/s more, and the tree its share of
  // them.
  const double expected_mg_ml = 350 * 5 / (kRootFlow_ml_s * (1 + 5 / kHeartOutput_ml_s));
  for (const int branch : {1, 2, 3, 4})
    // A parabola's outermost lamina has an eighteenth of the axis' velocity; after half a minute it is full.
    EXPECT_NEAR(bolus.iodine_mg_ml()[static_cast<std::size_t>(branch)].back(), expected_mg_ml,
                1e-3 * expected_mg_ml);
}

TEST_F(Bolus, PulsatesWithTheHeart) {
  double least = 1e9, largest = 0;
  for (int i = 0; i < 300; ++i) {
    bolus_.step(0.01, tip(0, 30), 1);
    if (i < 100) continue;
    least = std::min(least, bolus_.iodine_mg_ml()[0][40]);
    largest = std::max(largest, bolus_.iodine_mg_ml()[0][40]);
  }
  EXPECT_GT(largest, 1.5 * least) << "dense in diastole, dilute in systole";
}

TEST_F(Bolus, DoesNotGoUpstreamOrIntoOtherBranches) {
  for (int i = 0; i < 100; ++i) bolus_.step(0.033, tip(1, 20), 0.5);
  EXPECT_EQ(most(0), 0);
  EXPECT_EQ(most(2), 0);
  EXPECT_EQ(bolus_.iodine_mg_ml()[1].front(), 0);
  EXPECT_GT(most(3), 10);
  EXPECT_GT(most(4), 10);
}

TEST_F(Bolus, RefluxesWhereMoreIsInjectedThanFlows) {
  const double injection_ml_s = 2 * bolus_.mean_flow_ml_s(2);
  for (int i = 0; i < 60; ++i) bolus_.step(0.033, tip(2, 40), injection_ml_s);
  EXPECT_GT(bolus_.iodine_mg_ml()[2].front(), 100) << "back to the bifurcation";
  EXPECT_GT(most(1), 10) << "and on into the other branch";
  EXPECT_EQ(most(0), 0) << "the aorta flows faster than that";
  EXPECT_LE(most(2), 350 * (1 + 1e-12));
}

TEST_F(Bolus, RefluxesOutOfTheRootToo) {
  constexpr double kInjection_ml_s = 40;
  for (int i = 0; i < 60; ++i) bolus_.step(0.033, tip(1, 10), kInjection_ml_s);
  EXPECT_GT(bolus_.iodine_mg_ml()[0].front(), 100);
  const double injected_mg = 60 * 0.033 * kInjection_ml_s * 350;
  EXPECT_NEAR(bolus_.in_tree_mg() + bolus_.washed_out_mg(), injected_mg, 1e-9 * injected_mg);
}

/// When a trace, which adds no flow, reaches half of what it is in the end, in the last stretch of a branch.
double arrival_s(ContrastBolus& bolus, const VesselTree::Location& tip, std::size_t branch) {
  const double plateau_mg_ml = 350 * 1e-6 / kRootFlow_ml_s;
  double time_s = 0;
  for (; bolus.iodine_mg_ml()[branch].back() < 0.5 * plateau_mg_ml && time_s < 2; time_s += 0.002)
    bolus.step(0.002, tip, 1e-6);
  return time_s;
}

// The bar is 5 %. The tip's cell is 2 mm long, and so is the one that is read.
constexpr double kArrival_s = 3.0 / 170;
const Blood kParabola{.heart_rate_bpm = kSteady_bpm, .profile_exponent = 2};

TEST_F(Bolus, ArrivesWhenTheBloodDoes) {
  ContrastBolus bolus(tree_, kParabola);
  EXPECT_NEAR(arrival_s(bolus, tip(0, 30), 0), 70.0 / 170, kArrival_s);
}

TEST_F(Bolus, IsAsFastInNarrowBranchesAsInWideOnes) {
  const double velocity_mm_s = 170.0 * (4 * 4) / (3 * 3 + 2 * 2),
               expected_s = 70.0 / 170 + std::hypot(40, 50) / velocity_mm_s;
  for (const std::size_t branch : {1, 2}) {
    // A plug: a parabola's laminae mix at the bifurcation, which has no closed form.
    ContrastBolus bolus(tree_, {.heart_rate_bpm = kSteady_bpm, .profile_exponent = 1e6});
    EXPECT_NEAR(arrival_s(bolus, tip(0, 30), branch), expected_s, 2 * kArrival_s) << branch;
  }
}

/// As a stent does.
TEST(WidenedTree, ABranchHasItsFlowAgainWhereItsStenosisIsOpened) {
  const auto with_throat = [](double radius_mm) {
    std::vector<VesselBranch> branches{straight({0, 0, 0}, {0, 0, -100}, 4, -1),
                                       straight({0, 0, -100}, {40, 0, -150}, 3, 0),
                                       straight({0, 0, -100}, {-40, 0, -150}, 3, 0)};
    for (std::size_t i = 45; i <= 55; ++i) branches[1].points[i].radius_mm = radius_mm;
    return VesselTree(std::move(branches), "test");
  };
  const VesselTree narrow = with_throat(0.5), open = with_throat(3);
  ContrastBolus bolus(narrow, {.heart_rate_bpm = kSteady_bpm});
  const ContrastBolus healthy(open, {.heart_rate_bpm = kSteady_bpm});
  const double before_ml_s = bolus.flow().end_ml_s(1), healthy_ml_s = healthy.flow().end_ml_s(1);
  EXPECT_LT(before_ml_s, 0.8 * healthy_ml_s);
  bolus.take_radii(open);
  for (int step = 0; step < 100; ++step) bolus.step(0.1, place(0, 50), 0);
  // Steady flow settles by the windkessel's 1.4 s: exp(-7) is left of the difference after 10 s.
  EXPECT_NEAR(bolus.flow().end_ml_s(1), healthy_ml_s, 2e-3 * healthy_ml_s);
}

TEST(ClosedBranch, KeepsItsAgentUntilTheBalloonIsFolded) {
  const VesselTree vessels = tree();
  ContrastBolus bolus(vessels, {.heart_rate_bpm = kSteady_bpm});
  const auto in_mg = [&](std::size_t b) {
    double sum = 0;
    for (const double mg_ml : bolus.iodine_mg_ml()[b]) sum += mg_ml;
    return sum;
  };
  for (int i = 0; i < 100; ++i) bolus.step(0.01, place(2, 5), 1, 350);
  bolus.flow().fill({{.branch = 2, .from_mm = 40, .to_mm = 60, .radius_mm = 2}});
  const double before = in_mg(2);
  ASSERT_GT(before, 0);
  for (int i = 0; i < 300; ++i) bolus.step(0.01, place(0, 0), 0);
  // Rounding: no flow, and diffusion is across the vessel alone.
  EXPECT_NEAR(in_mg(2), before, 1e-9 * before);
  bolus.flow().fill({});
  for (int i = 0; i < 300; ++i) bolus.step(0.01, place(0, 0), 0);
  EXPECT_LT(in_mg(2), 0.1 * before);
}

TEST_F(Bolus, DividesTheFlowByAPowerOfTheRadii) {
  EXPECT_NEAR(bolus_.mean_flow_ml_s(0), kRootFlow_ml_s, 1e-12);
  EXPECT_NEAR(bolus_.mean_flow_ml_s(1), kRootFlow_ml_s * 9 / 13, 1e-12);
  const ContrastBolus murray(tree_, {.split_exponent = 3});
  EXPECT_NEAR(murray.mean_flow_ml_s(1), kRootFlow_ml_s * 27 / 35, 1e-12);
}

class GrownTrees : public testing::TestWithParam<std::uint32_t> {};

TEST_P(GrownTrees, KeepTheirIodineAndNeverExceedTheAgent) {
  const VesselTree tree = grown(GetParam());
  ContrastBolus bolus(tree);
  std::mt19937 dice(GetParam());
  double injected_mg = 0;
  for (int i = 0; i < 60; ++i) {
    const auto branch = static_cast<int>(dice() % tree.branches().size());
    const double rate_ml_s = dice() % 3 == 0 ? 0 : static_cast<double>(dice() % 1000) / 100;
    const double length_mm = tree.branches()[static_cast<std::size_t>(branch)].arc_length_mm.back();
    bolus.step(0.05, place(branch, length_mm * static_cast<double>(dice() % 100) / 99), rate_ml_s);
    injected_mg += 0.05 * rate_ml_s * 350;
    ASSERT_NEAR(bolus.in_tree_mg() + bolus.washed_out_mg(), injected_mg, 1e-9 * injected_mg);
    for (const std::vector<double>& segments : bolus.iodine_mg_ml())
      for (const double mg_ml : segments) {
        ASSERT_GE(mg_ml, -1e-9);
        ASSERT_LE(mg_ml, 350 * (1 + 1e-9));
      }
  }
}

TEST_P(GrownTrees, AreReachedTheLaterTheFartherDownstream) {
  const VesselTree tree = grown(GetParam());
  ContrastBolus bolus(tree, {.heart_rate_bpm = kSteady_bpm});
  const std::size_t count = tree.branches().size();
  constexpr double kStep_s = 0.02, kNever_s = 1e9;
  std::vector<double> first_s(count, kNever_s), last_s(count, kNever_s);
  for (int i = 0; i < 400; ++i) {
    bolus.step(kStep_s, place(0, 5), 1);
    for (std::size_t b = 0; b < count; ++b) {
      constexpr double kSeen_mg_ml = 0.5;
      const std::vector<double>& segments = bolus.iodine_mg_ml()[b];
      if (segments.front() > kSeen_mg_ml) first_s[b] = std::min(first_s[b], kStep_s * i);
      if (segments.back() > kSeen_mg_ml) last_s[b] = std::min(last_s[b], kStep_s * i);
    }
  }
  for (std::size_t b = 1; b < count; ++b) {
    EXPECT_LE(first_s[b], last_s[b]) << b;
    EXPECT_LE(last_s[static_cast<std::size_t>(tree.branches()[b].parent)], first_s[b] + kStep_s) << b;
    EXPECT_LT(first_s[b], kNever_s) << b;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, GrownTrees, testing::Range(1u, 9u));

}  // namespace
}  // namespace xraycast::test::contrast_bolus_test
