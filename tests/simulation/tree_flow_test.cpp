#include "xraycast/blood_flow/tree_flow.hpp"

#include "straight_vessels.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/blood_flow/flow_cycle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

namespace xraycast::tree_flow_test {
namespace {

/// Halves a branch's radius over a tenth of its length.
VesselBranch stenosed(VesselBranch branch) {
  for (std::size_t i = 45; i < 55; ++i) branch.points[i].radius_mm *= 0.5;
  return branch;
}

constexpr int kAorta = 0, kRenal = 1, kLower = 3, kIliac = 6;

/// An aorta with renal arteries, a coeliac trunk, iliac arteries.
VesselTree trunk(bool has_stenosis = false) {
  VesselBranch renal = straight({0, 0, -250}, {60, 0, -260}, 3, 0, "left renal artery");
  if (has_stenosis) renal = stenosed(renal);
  return VesselTree({straight({0, 0, 0}, {0, 0, -250}, 12, -1, "aorta"), renal,
                     straight({0, 0, -250}, {-60, 0, -260}, 3, 0, "right renal artery"),
                     straight({0, 0, -250}, {0, 0, -300}, 10, 0, "aorta"),
                     straight({0, 0, -300}, {0, 60, -320}, 3.5, 3, "coeliac trunk"),
                     straight({0, 0, -300}, {0, 0, -380}, 9, 3, "aorta"),
                     straight({0, 0, -380}, {60, 0, -480}, 5, 5, "left common iliac artery"),
                     straight({0, 0, -380}, {-60, 0, -480}, 5, 5, "right common iliac artery")},
                    "trunk");
}

VesselTree coronary(bool has_stenosis = false) {
  VesselBranch descending = straight({10, 0, 0}, {60, 0, -60}, 1.6, 0, "left anterior descending artery");
  if (has_stenosis) descending = stenosed(descending);
  return VesselTree({straight({0, 0, 0}, {10, 0, 0}, 2, -1, "left main coronary artery"), descending,
                     straight({10, 0, 0}, {10, 50, -40}, 1.5, 0, "circumflex artery")},
                    "coronary");
}

struct Cycle {
  double mean = 0, largest = std::numeric_limits<double>::lowest(),
         least = std::numeric_limits<double>::max();
  void add(double value, double share) {
    mean += share * value;
    largest = std::max(largest, value);
    least = std::min(least, value);
  }
};

/// A beat in steps of a millisecond; `seen` is told of each, with its share of the beat.
template <typename Seen>
void beat(TreeFlow& flow, const Seen& seen, const VesselTree::Location& tip = {}, double injection_ml_s = 0) {
  const int steps = static_cast<int>(std::lround(flow.heart().period_s() / 1e-3));
  for (int i = 0; i < steps; ++i) {
    flow.step(flow.heart().period_s() / steps, tip, injection_ml_s);
    seen(1.0 / steps);
  }
}

Cycle flow_in(TreeFlow& flow, std::size_t branch, const VesselTree::Location& tip = {},
              double injection_ml_s = 0) {
  Cycle cycle;
  beat(
      flow, [&](double share) { cycle.add(flow.start_ml_s(branch), share); }, tip, injection_ml_s);
  return cycle;
}

TEST(TreeFlow, HasThePressuresOfABodyAtRest) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  Cycle aorta, iliac;
  beat(flow, [&](double share) {
    aorta.add(flow.aortic_mmHg(), share);
    iliac.add(flow.pressure_mmHg(place(kIliac, 100)), share);
  });
  EXPECT_NEAR(aorta.mean, 93, 0.5);
  // 120 over 80 and what is normal about it (McEniery et al., J Am Coll Cardiol 46:1753, 2005: 42 +- 8 at 50
  // years).
  EXPECT_NEAR(aorta.largest, 120, 8);
  EXPECT_NEAR(aorta.least, 80, 8);
  EXPECT_NEAR(aorta.largest - aorta.least, 42, 8);
  EXPECT_LT(iliac.mean, aorta.mean);
  EXPECT_GT(iliac.largest, aorta.largest) << "the pulse grows on its way";
}

/// As where a tree begins at the groin.
TEST(FlowCycle, SaysThatBloodEntersBesideTheAorta) {
  Progress progress;
  const auto notes_of = [&](const VesselTree& tree) {
    return flow_cycle({.tree = std::make_shared<VesselTree>(tree)}, progress).notes;
  };
  EXPECT_TRUE(notes_of(trunk()).empty());
  EXPECT_TRUE(notes_of(coronary()).empty());
  const std::vector<std::string> notes =
      notes_of(VesselTree({straight({0, 0, -480}, {0, 0, -380}, 5, -1, "left common iliac artery"),
                           straight({0, 0, -380}, {0, 0, 0}, 10, 0, "aorta")},
                          "upwards"));
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(notes[0].find("the tree's root is left common iliac artery"), std::string::npos) << notes[0];
}

TEST(TreeFlow, BeginsWithABeatLikeAllOthers) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  std::vector<double> first, later;
  beat(flow, [&](double) { first.push_back(flow.aortic_mmHg()); });
  for (int n = 0; n < 20; ++n) beat(flow, [](double) {});
  beat(flow, [&](double) { later.push_back(flow.aortic_mmHg()); });
  // Of 93 mmHg: what a windkessel of 1.4 s has left after the beats that begin() takes.
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_NEAR(first[i], later[i], 0.1) << i;
}

TEST(TreeFlow, GivesArteriesTheirShares) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  std::array<double, 8> mean{};
  beat(flow, [&](double share) {
    for (std::size_t b = 0; b < mean.size(); ++b) mean[b] += share * flow.end_ml_s(b);
  });
  // Published shares of 5 l/min; the resistances are set by them, so that only the beat's numerics differ.
  EXPECT_NEAR(mean[1], 0.095 * 5000 / 60, 1e-2 * mean[1]);
  EXPECT_NEAR(mean[2], 0.095 * 5000 / 60, 1e-2 * mean[2]);
  EXPECT_NEAR(mean[4], 0.115 * 5000 / 60, 1e-2 * mean[4]);
  EXPECT_NEAR(mean[6], mean[7], 1e-6);
  EXPECT_NEAR(mean[0], 170 * std::numbers::pi * 12 * 12 * 1e-3, 1e-2 * mean[0]);
  for (std::size_t b = 0; b < mean.size(); ++b) EXPECT_NEAR(mean[b], flow.rest_ml_s(b), 1e-2 * mean[b]) << b;
}

/// The flow in the ascending aorta of a heart that gives so much, with a little backflow as its valve closes.
std::shared_ptr<const HeartWaveform> measured(double mean_ml_s) {
  HeartWaveform waveform{
      {{0, 0}, {0.05, 180}, {0.12, 420}, {0.2, 330}, {0.3, 90}, {0.34, -40}, {0.38, 0}, {0.9, 0}}};
  const double scale = mean_ml_s / waveform.mean_ml_s();
  for (HeartWaveform::Sample& sample : waveform.samples) sample.ml_s *= scale;
  return std::make_shared<const HeartWaveform>(waveform);
}

TEST(TreeFlow, FollowsAHeartsOwnWaveform) {
  const VesselTree tree = trunk();
  TreeFlow rest(tree, {.heart = measured(kHeartOutput_ml_s)}), more(tree, {.heart = measured(150)});
  EXPECT_NEAR(rest.heart().period_s(), 0.9, 1e-12);
  Cycle aorta, aorta_of_more;
  beat(rest, [&](double share) { aorta.add(rest.aortic_mmHg(), share); });
  beat(more, [&](double share) { aorta_of_more.add(more.aortic_mmHg(), share); });
  // As of a heart at rest; what it gives goes through a periphery that is set by it.
  EXPECT_NEAR(aorta.mean, 93, 1);
  EXPECT_NEAR(aorta_of_more.mean, 93, 2);
  const Cycle renal = flow_in(rest, kRenal), renal_of_more = flow_in(more, kRenal);
  EXPECT_NEAR(renal.mean, 0.095 * kHeartOutput_ml_s, 1e-2 * renal.mean);
  EXPECT_NEAR(renal_of_more.mean, 0.095 * 150, 1e-2 * renal_of_more.mean);
  // All arteries share what there is as at rest.
  for (std::size_t b = 0; b < tree.branches().size(); ++b)
    EXPECT_NEAR(more.rest_ml_s(b) / rest.rest_ml_s(b), 150 / kHeartOutput_ml_s, 1e-9) << b;
  // The same waveform from another instant on is the same beat, later.
  HeartWaveform turned;
  for (int i = 0; i <= 900; ++i)
    turned.samples.push_back({1e-3 * i, kHeartOutput_ml_s * rest.heart().ejection(1e-3 * i + 0.25)});
  TreeFlow late(tree, {.heart = std::make_shared<const HeartWaveform>(turned)});
  for (int i = 0; i < 250; ++i) rest.step(1e-3, {}, 0);
  for (int i = 0; i < 900; ++i) {
    rest.step(1e-3, {}, 0);
    late.step(1e-3, {}, 0);
    // What linear interpolation between samples changes, and the windkessel's beginning.
    ASSERT_NEAR(late.aortic_mmHg(), rest.aortic_mmHg(), 0.3) << i;
  }
}

TEST(TreeFlow, FillsCoronariesInTheDiastoleOfAWaveformToo) {
  const VesselTree tree = coronary();
  TreeFlow flow(tree, {.heart = measured(kHeartOutput_ml_s)});
  double all_ml = 0, diastolic_ml = 0;
  for (int i = 0; i < 900; ++i) {
    flow.step(1e-3, {}, 0);
    all_ml += flow.start_ml_s(1);
    if (i > 340) diastolic_ml += flow.start_ml_s(1);
  }
  // Ofili et al., Am Heart J 130:37, 1995: 0.7 to 0.9 in the anterior descending artery.
  EXPECT_NEAR(diastolic_ml / all_ml, 0.8, 0.1);
}

TEST(TreeFlow, HasTheResistiveIndexOfARenalArtery) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  const Cycle renal = flow_in(flow, kRenal);
  // 0.6 +- 0.05 in normal kidneys.
  EXPECT_NEAR((renal.largest - renal.least) / renal.largest, 0.6, 0.05);
}

TEST(TreeFlow, IsSteadyWithoutAHeart) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {.heart_rate_bpm = 0});
  for (int i = 0; i < 100; ++i) {
    flow.step(1e-3, {}, 0);
    // Every constant was chosen for this state; rounding.
    EXPECT_NEAR(flow.aortic_mmHg(), 93, 1e-6);
    for (std::size_t b = 0; b < 8; ++b) EXPECT_NEAR(flow.start_ml_s(b), flow.rest_ml_s(b), 1e-6);
  }
  // Poiseuille's drop along the aorta.
  const double drop_mmHg =
      8 * 3.5e-3 * 0.25 / (std::numbers::pi * std::pow(0.012, 4)) * 1e-6 * flow.rest_ml_s(0) / 133.322;
  EXPECT_NEAR(93 - flow.pressure_mmHg(place(kAorta, 250)), drop_mmHg, 1e-3 * drop_mmHg);
  EXPECT_NEAR(93 - flow.pressure_mmHg(place(kAorta, 100)), 0.4 * drop_mmHg, 1e-3 * drop_mmHg);
}

TEST(TreeFlow, RefluxesByHowMuchIsInjected) {
  // A renal artery whose own flow is 5 ml/s in the mean: 3.06 mm at 170 mm/s, without a name.
  const double radius_mm = std::sqrt(5 * 1000 / (170 * std::numbers::pi));
  const VesselTree tree(
      {straight({0, 0, 0}, {0, 0, -250}, 12, -1), straight({0, 0, -250}, {60, 0, -260}, radius_mm, 0),
       straight({0, 0, -250}, {0, 0, -350}, std::sqrt(144 - radius_mm * radius_mm), 0)},
      "renal");
  TreeFlow flow(tree, {});
  const Cycle own = flow_in(flow, kRenal);
  EXPECT_NEAR(own.mean, 5, 0.05);
  const VesselTree::Location tip = place(kRenal, 20);
  beat(
      flow, [](double) {}, tip, 10);
  EXPECT_LT(flow_in(flow, kRenal, tip, 10).largest, 0) << "over the whole cycle";
  beat(
      flow, [](double) {}, tip, 5);
  double systolic_ml_s = -1e9, diastolic_ml_s = -1e9, time_s = 0;
  beat(
      flow,
      [&](double share) {
        time_s += share * flow.heart().period_s();
        (time_s < flow.heart().ejection_s() ? systolic_ml_s : diastolic_ml_s) = std::max(
            time_s < flow.heart().ejection_s() ? systolic_ml_s : diastolic_ml_s, flow.start_ml_s(kRenal));
      },
      tip, 5);
  EXPECT_GT(systolic_ml_s, 2) << "not in systole";
  EXPECT_LT(flow.start_ml_s(kRenal), -1) << "at the end of diastole";
  beat(
      flow, [](double) {}, tip, 1);
  EXPECT_GT(flow_in(flow, kRenal, tip, 1).least, 0) << "never";
}

TEST(TreeFlow, IsNotChangedByAnInjectionOfNothing) {
  const VesselTree tree = trunk(true);
  TreeFlow still(tree, {}), moved(tree, {});
  for (int i = 0; i < 200; ++i) {
    still.step(1e-3, {}, 0);
    moved.step(1e-3, place(i % 8, i % 40), 0);
    for (std::size_t b = 0; b < 8; ++b) ASSERT_NEAR(still.start_ml_s(b), moved.start_ml_s(b), 1e-12);
  }
}

TEST(TreeFlow, PassesOnWhatIsInjected) {
  const VesselTree tree = trunk(true);
  TreeFlow flow(tree, {});
  for (int i = 0; i < 400; ++i) {
    const auto branch = static_cast<std::size_t>(i / 10 % 8);
    const double injection_ml_s = i % 7;
    flow.step(1e-3, place(static_cast<int>(branch), i % 50), injection_ml_s);
    // Sums of a few terms of up to 100 ml/s.
    for (std::size_t b = 0; b < 8; ++b) {
      ASSERT_NEAR(flow.end_ml_s(b) - flow.start_ml_s(b), b == branch ? injection_ml_s : 0, 1e-11);
      double leaving_ml_s = 0;
      for (const int child : tree.branches()[b].children)
        leaving_ml_s += flow.start_ml_s(static_cast<std::size_t>(child));
      const bool divides = !tree.branches()[b].children.empty();
      ASSERT_NEAR(divides ? flow.end_ml_s(b) : 0, leaving_ml_s, 1e-11);
    }
  }
}

TEST(TreeFlow, FallsAtAStenosis) {
  const VesselTree healthy = trunk(), narrow = trunk(true);
  TreeFlow before(healthy, {}), after(narrow, {});
  EXPECT_EQ(before.rest_ml_s(kRenal), after.rest_ml_s(kRenal));
  const double healthy_ml_s = flow_in(before, kRenal).mean, narrow_ml_s = flow_in(after, kRenal).mean;
  EXPECT_LT(narrow_ml_s, 0.99 * healthy_ml_s);
  EXPECT_GT(narrow_ml_s, 0.8 * healthy_ml_s);
  EXPECT_GT(flow_in(after, 2).mean, flow_in(before, 2).mean) << "the other kidney gets more";
}

TEST(TreeFlow, ComesBackOnceAStenosisIsOpened) {
  const VesselTree tree = trunk(true);
  TreeFlow flow(tree, {});
  const TreeFlow::Filling wire{.branch = kRenal, .from_mm = 0, .to_mm = 60, .radius_mm = 0.2};
  flow.fill({wire});
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  const double before_ml_s = flow_in(flow, kRenal).mean;
  flow.set_lumen(kRenal, healthy_radii_mm(tree.branches()[kRenal]));
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  const double wired_ml_s = flow_in(flow, kRenal).mean;
  EXPECT_GT(wired_ml_s, 1.03 * before_ml_s);
  flow.fill({});
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  EXPECT_NEAR(flow_in(flow, kRenal).mean, flow.rest_ml_s(kRenal), 0.002 * flow.rest_ml_s(kRenal));
  EXPECT_LT(wired_ml_s, flow_in(flow, kRenal).mean) << "the wire was still there";
}

TEST(TreeFlow, FillsTheHeartInDiastole) {
  const VesselTree tree = coronary();
  TreeFlow flow(tree, {});
  double systole_ml = 0, diastole_ml = 0, time_s = 0;
  beat(flow, [&](double share) {
    time_s += share * flow.heart().period_s();
    (time_s < flow.heart().ejection_s() ? systole_ml : diastole_ml) += share * flow.start_ml_s(1);
  });
  // 0.7 to 0.9 of the left anterior descending artery's flow is diastolic (Ofili et al., Am Heart J 130:37,
  // 1995).
  EXPECT_NEAR(diastole_ml / (systole_ml + diastole_ml), 0.8, 0.1);
  EXPECT_NEAR(systole_ml + diastole_ml, flow.rest_ml_s(1), 0.01 * flow.rest_ml_s(1));
  EXPECT_NEAR(flow.rest_ml_s(0), 0.027 * 5000 / 60, 1e-9);
}

/// At the end of the left anterior descending artery.
double ratio(const VesselTree& tree, double resistance) {
  Progress progress;
  const FlowRequest request{std::make_shared<const VesselTree>(tree), {.coronary_resistance = resistance}};
  return flow_cycle(request, progress).pressure_ratio(1);
}

TEST(TreeFlow, LosesPressureBehindAStenosisAtHyperaemia) {
  const VesselTree healthy = coronary(), narrow = coronary(true);
  const double length_mm = narrow.branches()[1].arc_length_mm.back();
  const double reserve = fractional_flow_reserve(narrow, place(1, length_mm));
  EXPECT_GT(fractional_flow_reserve(healthy, place(1, length_mm)), 0.9)
      << "normal is 0.94 to 1 (Pijls et al.)";
  EXPECT_NEAR(ratio(narrow, kHyperaemia), reserve, 1e-12);
  // A stenosis of half of the diameter: reserves of 0.6 to 0.9 are seen (Tonino et al., J Am Coll Cardiol
  // 55:2816, 2010).
  EXPECT_GT(reserve, 0.6);
  EXPECT_LT(reserve, 0.9);
  EXPECT_GT(ratio(narrow, 1), reserve + 0.05) << "at rest much less";
  // Its drop behind the stenosis, none before it.
  EXPECT_GT(fractional_flow_reserve(narrow, place(1, 0.3 * length_mm)), 0.95);
}

TEST(TreeFlow, StandsStillWhereItIsWedged) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  flow.fill({{.branch = kRenal, .from_mm = 0, .to_mm = 20, .radius_mm = 3}});
  beat(flow, [](double) {});
  EXPECT_EQ(flow_in(flow, kRenal).largest, 0);
  EXPECT_GT(flow_in(flow, 2).mean, 7.9);
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  // The compliance behind it runs empty through the periphery, whose time constant is 0.2 s.
  EXPECT_NEAR(flow.pressure_mmHg(place(kRenal, 50)), TreeFlow::kVenous_mmHg, 0.1);
  // What is injected can go one way only.
  flow.fill({{.branch = kRenal, .from_mm = 0, .to_mm = 20.2, .radius_mm = 3}});
  flow.step(1e-3, place(kRenal, 20.2), 2);
  EXPECT_EQ(flow.start_ml_s(kRenal), 0);
  EXPECT_NEAR(flow.end_ml_s(kRenal), 2, 1e-12);
  flow.fill({});
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  EXPECT_NEAR(flow_in(flow, kRenal).mean, flow.rest_ml_s(kRenal), 0.01 * flow.rest_ml_s(kRenal));
}

TEST(TreeFlow, RunsEmptyBehindABalloon) {
  // A catheter to the end of the branch, and a balloon of 20 mm on it that fills the branch.
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {.heart_rate_bpm = 0});
  const double before_mmHg = flow.aortic_mmHg();
  const auto step = [&](double time_s) {
    for (int i = 0; i < static_cast<int>(std::round(1e3 * time_s)); ++i) flow.step(1e-3, place(0, 0), 0);
  };
  const TreeFlow::Filling catheter{.branch = kRenal, .from_mm = 0, .to_mm = 58, .radius_mm = 0.4};
  const auto balloon = [](double radius_mm) {
    return TreeFlow::Filling{.branch = kRenal, .from_mm = 20, .to_mm = 40, .radius_mm = radius_mm};
  };
  // The less flows the wider it is.
  double last_ml_s = flow.rest_ml_s(kRenal);
  for (const double radius_mm : {1.5, 2.4, 2.7, 2.9}) {
    flow.fill({catheter, balloon(radius_mm)});
    step(3);
    EXPECT_LT(flow.end_ml_s(kRenal), last_ml_s) << radius_mm;
    last_ml_s = flow.end_ml_s(kRenal);
  }
  EXPECT_GT(last_ml_s, 0);
  // Ten of the windkessel's time constants.
  flow.fill({catheter});
  step(15);
  const double behind_mmHg = flow.pressure_mmHg(place(kRenal, 55));
  flow.fill({catheter, balloon(3)});
  // The periphery's compliance discharges through its distal resistance into the veins: 0.15 of the arterial
  // compliance, and 0.91 of the resistance, both in proportion to the flow at rest.
  const double windkessel_s = 0.79 * 1.75, rest_mmHg = behind_mmHg - TreeFlow::kVenous_mmHg,
               constant_s = 0.15 * windkessel_s * 0.91;
  double time_s = 0;
  // As the periphery's proximal resistance bears no flow any more, the pressure behind the balloon is the
  // compliance's at once: 0.09 of the drop lower.
  for (const double until_s : {0.05, 0.2, 0.5}) {
    step(until_s - time_s);
    time_s = until_s;
    const double expected_mmHg = TreeFlow::kVenous_mmHg + 0.91 * rest_mmHg * std::exp(-time_s / constant_s);
    // What the branch loses at rest, a tenth of a mmHg, and what of the catheter's drop is not there at rest.
    EXPECT_NEAR(flow.pressure_mmHg(place(kRenal, 55)), expected_mmHg, 0.005 * rest_mmHg) << time_s;
    EXPECT_EQ(flow.start_ml_s(kRenal), 0);
    EXPECT_EQ(flow.end_ml_s(kRenal), 0);
  }
  // The others share the heart's output: the aorta's pressure rises by the flow that has no way any more.
  step(10);
  const double output_ml_s = 5000.0 / 60, without_ml_s = output_ml_s - flow.rest_ml_s(kRenal);
  // Drops in the tree, which grow with the flow, are a hundredth of the pressure.
  EXPECT_NEAR(flow.aortic_mmHg() - TreeFlow::kVenous_mmHg,
              (before_mmHg - TreeFlow::kVenous_mmHg) * output_ml_s / without_ml_s, 0.1);
  EXPECT_NEAR(flow.pressure_mmHg(place(kRenal, 10)), flow.aortic_mmHg(), 0.5) << "before the balloon";
  flow.fill({catheter});
  step(15);
  EXPECT_NEAR(flow.pressure_mmHg(place(kRenal, 55)), behind_mmHg, 0.01);
}

TEST(TreeFlow, IsNarrowedByAnInstrument) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  flow.fill({{.branch = kRenal, .from_mm = 0, .to_mm = 60, .radius_mm = 1.5}});
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  EXPECT_LT(flow_in(flow, kRenal).mean, 0.99 * flow.rest_ml_s(kRenal));
  EXPECT_GT(flow_in(flow, kRenal).mean, 0.5 * flow.rest_ml_s(kRenal));
}

TEST(TreeFlow, IsClosedAndEmbolised) {
  const VesselTree tree = trunk();
  TreeFlow flow(tree, {});
  flow.set_conductance(kLower, 0);
  // What the peripheries exchange with each other dies away with their time constant, 0.2 s.
  for (int i = 0; i < 5; ++i) beat(flow, [](double) {});
  for (const std::size_t b : {3, 5, 6, 7}) EXPECT_NEAR(flow_in(flow, b).largest, 0, 1e-4) << b;
  flow.set_conductance(kLower, 1);
  flow.set_periphery(kRenal, 0.1);
  for (int i = 0; i < 10; ++i) beat(flow, [](double) {});
  EXPECT_NEAR(flow_in(flow, kRenal).mean, 0.1 * flow.rest_ml_s(kRenal), 0.01 * flow.rest_ml_s(kRenal));
}

TEST(TreeFlow, RefusesOutletsWithoutResistance) {
  const VesselTree tree = trunk();
  const auto message = [&](const Blood& blood) -> std::string {
    try {
      const TreeFlow flow(tree, blood);
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(message({.other_resistance = 0}),
            "`other_resistance` 0: outlets need a resistance of 0.001 to 1000 of that at rest");
  EXPECT_EQ(message({.coronary_resistance = std::nan("")}),
            "`coronary_resistance` nan: outlets need a resistance of 0.001 to 1000 of that at rest");
  EXPECT_EQ(message({.heart_rate_bpm = 7}), "`heart_rate_bpm` 7: must be 0, for a steady flow, or 20 to 250");
  EXPECT_EQ(message({.root_velocity_mm_s = -1}),
            "`root_velocity_mm_s` -1: must be above 0 and at most 2000 mm/s");
  EXPECT_EQ(message({.heart = std::make_shared<const HeartWaveform>(
                         HeartWaveform{{{0, 0}, {0.4, -100}, {0.8, 0}}})}),
            "`heart_waveform`: its mean is -50 ml/s; a heart gives 1 to 1000 ml/s: turn the sign");
}

TEST(RestShare, IsKnownOfArteriesByTheirNames) {
  EXPECT_EQ(rest_share("left renal artery"), 0.095);
  EXPECT_EQ(rest_share("superior mesenteric artery"), 0.12);
  EXPECT_EQ(rest_share("right common carotid artery"), 0.072);
  EXPECT_EQ(rest_share("common hepatic artery"), 0.07);
  EXPECT_EQ(rest_share("left main"), 0.027);
  for (const char* other : {"aorta", "", "left middle suprarenal artery", "right adrenal artery",
                            "right hepatic artery", "left main portal vein"})
    EXPECT_EQ(rest_share(other), 0) << other;
  EXPECT_EQ(coronary_of("right coronary artery"), Coronary::right);
  EXPECT_EQ(coronary_of("left anterior descending artery"), Coronary::left);
  for (const char* left : {"left circumflex artery", "circumflex", "left main", "LAD", "circumflex branch"})
    EXPECT_EQ(coronary_of(left), Coronary::left) << left;
  for (const char* other : {"left renal artery", "deep circumflex iliac artery", "left main portal vein",
                            "lateral circumflex femoral artery", "posterior circumflex humeral artery"})
    EXPECT_EQ(coronary_of(other), Coronary::none) << other;
}

}  // namespace
}  // namespace xraycast::tree_flow_test
