#include "xraycast/simulation/instrument_pressures.hpp"

#include "xraycast/blood_flow/flow_cycle.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

namespace xraycast::instrument_pressures_test {
namespace {

VesselBranch straight(glm::dvec3 from_mm, glm::dvec3 to_mm, double radius_mm, int parent) {
  VesselBranch branch;
  branch.parent = parent;
  constexpr int kStretches = 50;
  for (int i = 0; i <= kStretches; ++i)
    branch.points.push_back({from_mm + (to_mm - from_mm) * (static_cast<double>(i) / kStretches), radius_mm});
  return branch;
}

/// An aorta of 100 mm from above, two legs of 100 mm, of which the second one has two branches more.
VesselTree tree() {
  return VesselTree({straight({0, 0, 100}, {0, 0, 0}, 8, -1), straight({0, 0, 0}, {60, 0, -80}, 5, 0),
                     straight({0, 0, 0}, {-60, 0, -80}, 5, 0), straight({-60, 0, -80}, {-60, 0, -180}, 3, 2),
                     straight({-60, 0, -80}, {-140, 0, -140}, 3, 2)},
                    "legs");
}

InstrumentTip tip(int branch, double arc_length_mm) {
  InstrumentTip tip;
  tip.branch = branch;
  tip.arc_length_mm = arc_length_mm;
  return tip;
}

VesselEnd entry(int branch, bool at_start = false) {
  VesselEnd end;
  end.branch = branch;
  end.at_start = at_start;
  return end;
}

/// Branch, from and to of each in whole mm, by the branches' numbers.
std::vector<std::vector<double>> ways(const VesselEnd& end, const InstrumentTip& at) {
  std::vector<std::vector<double>> all;
  for (const TreeFlow::Filling& filling : fillings_of(tree(), end, at, 0.8))
    all.push_back(
        {static_cast<double>(filling.branch), std::round(filling.from_mm), std::round(filling.to_mm)});
  std::ranges::sort(all);
  return all;
}

using Ways = std::vector<std::vector<double>>;

/// At the end of the third branch and in the aorta, sampled at these times over three beats.
template <typename Next>
TipPressures readings(const Blood& blood, const Next& next) {
  static const VesselTree legs = tree();
  TreeFlow flow(legs, blood);
  TipPressures pressures;
  double due_s = 0;
  for (double time_s = 1e-3; time_s < 3 * flow.heart().period_s(); time_s += 1e-3) {
    flow.step(1e-3, {}, 0);
    if (time_s < due_s - 1e-9) continue;
    pressures.add(time_s, flow, {tip(3, 100), tip(0, 0)});
    due_s = next(time_s);
  }
  return pressures;
}

TEST(TipPressures, AreThoseOfTheLastHeartbeat) {
  const FlowRequest request{.tree = std::make_shared<const VesselTree>(tree())};
  Progress progress;
  const FlowCycle cycle = flow_cycle(request, progress);
  const CycleFigures wanted = figures_of(cycle.vessels[3].mmHg), aorta = figures_of(cycle.aortic_mmHg);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> waits(0.002, 0.06);
  const TipPressures fine = readings({}, [](double at_s) { return at_s + 1e-3; });
  const TipPressures uneven = readings({}, [&](double at_s) { return at_s + waits(random); });
  // A sample of the beat more or less; at uneven times up to 60 ms apart what lies between is not seen.
  for (const auto& [told, tolerance_mmHg, of_mean_mmHg] :
       {std::tuple{&fine, 0.3, 0.05}, std::tuple{&uneven, 3.0, 0.3}}) {
    EXPECT_NEAR(told->tip(0).systolic_mmHg, wanted.most, tolerance_mmHg);
    EXPECT_NEAR(told->tip(0).diastolic_mmHg, wanted.least, tolerance_mmHg);
    EXPECT_NEAR(told->tip(0).mean_mmHg, wanted.mean, of_mean_mmHg);
    EXPECT_NEAR(told->tip_means_mmHg()[0], told->tip(0).mean_mmHg, 1e-12);
    EXPECT_NEAR(told->aorta().mean_mmHg, aorta.mean, of_mean_mmHg);
    EXPECT_NEAR(told->tip(1).systolic_mmHg, told->aorta().systolic_mmHg, 1);
  }
}

TEST(TipPressures, AreAllTheSameOfASteadyFlow) {
  const TipPressures steady = readings({.heart_rate_bpm = 0}, [](double at_s) { return at_s + 0.02; });
  const PressureReading tip = steady.tip(0);
  EXPECT_NEAR(tip.systolic_mmHg, tip.diastolic_mmHg, 1e-6);
  EXPECT_NEAR(tip.mean_mmHg, tip.now_mmHg, 1e-6);
  EXPECT_EQ(in_words({100, 119.6, 71.2, 88}), "120/71 mmHg, mean 88");
  EXPECT_EQ(TipPressures().tip(0).mean_mmHg, 0);
}

TEST(InstrumentPressures, AreInTheReportFromTheFirstStepOn) {
  RunRequest request{.tree = std::make_shared<const VesselTree>(tree()),
                     .instruments = instruments_named({"microcatheter-27f"}),
                     .entry = {.end = 1}};
  request.script = Script::parse("time_s,insertion_mm,rotation_deg\n0,0,0\n2,80,0\n", "test");
  Progress progress;
  std::optional<RunMonitor> monitor;
  run(request, progress, [&](const Instruments& moved, double, const InstrumentPressures& blood) {
    if (monitor)
      monitor->add(moved, with_blood({}, request, blood));
    else
      monitor.emplace(moved, names_of(request.instruments));
  });
  const auto told = nlohmann::json::parse(monitor->json(true))["series"];
  ASSERT_EQ(told["instruments"][0]["pressure_mmHg"].size(), told["time_s"].size());
  ASSERT_GE(told["time_s"].size(), 5U);
  for (const double mmHg : told["instruments"][0]["pressure_mmHg"]) EXPECT_NEAR(mmHg, 90, 5);
}

TEST(Fillings, GoUpFromTheEntryAndDownToTheTip) {
  EXPECT_EQ(ways(entry(1), tip(3, 40)), (Ways{{1, 0, 100}, {2, 0, 100}, {3, 0, 40}}));
  EXPECT_EQ(ways(entry(3), tip(4, 30)), (Ways{{3, 0, 100}, {4, 0, 30}}));
}

TEST(Fillings, ReachIntoABranchThatGoesOn) {
  EXPECT_EQ(ways(entry(1), tip(0, 70)), (Ways{{0, 70, 100}, {1, 0, 100}}));
  EXPECT_EQ(ways(entry(3), tip(2, 25)), (Ways{{2, 25, 100}, {3, 0, 100}}));
}

TEST(Fillings, LieInTheBranchOfTheEntry) {
  EXPECT_EQ(ways(entry(3), tip(3, 60)), (Ways{{3, 60, 100}}));
  EXPECT_EQ(ways(entry(0, true), tip(0, 20)), (Ways{{0, 0, 20}}));
  EXPECT_EQ(ways(entry(0, true), tip(4, 10)), (Ways{{0, 0, 100}, {2, 0, 100}, {4, 0, 10}}));
}

TEST(Run, TellsThePressureAtTheTip) {
  const auto vessels = std::make_shared<const VesselTree>(tree());
  RunRequest request{
      .tree = vessels,
      .script = Script::parse("time_s,insertion_mm,rotation_deg\n0,20,0\n2,60,0\n", "push.csv"),
      .interval_s = 0.1};
  Progress progress;
  const auto told = run(request, progress);
  ASSERT_EQ(told.pressures.size(), 201u) << "a hundred a second, and the beginning";
  double least = 1e9, most = 0;
  for (const PressureSample& sample : told.pressures) {
    ASSERT_EQ(sample.tips_mmHg.size(), 1u);
    least = std::min(least, sample.tips_mmHg[0]);
    most = std::max(most, sample.tips_mmHg[0]);
  }
  // More than a beat of a pulse about 93 mmHg.
  EXPECT_NEAR(0.5 * (least + most), 93, 8);
  EXPECT_GT(most - least, 25);
  EXPECT_EQ(told.records.front()[0].pressure_mmHg, told.pressures.front().tips_mmHg[0]);
  request.blood.heart_rate_bpm = 0;
  const auto steady = run(request, progress);
  // The catheter narrows the leg in which it lies.
  EXPECT_NEAR(steady.last[0].aortic_mmHg, 93, 1);
  EXPECT_LE(steady.last[0].pressure_mmHg, steady.last[0].aortic_mmHg);
}

}  // namespace
}  // namespace xraycast::instrument_pressures_test
