#include "xraycast/simulation/instrument_pressures.hpp"

#include "xraycast/simulation/run.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
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
