#include "xraycast/simulation/run_report.hpp"

#include "xraycast/simulation/run.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace xraycast::run_report_test {
namespace {

/// A straight vessel of 200 mm along z, entered from below.
class RunReportTest : public testing::Test {
 protected:
  RunReportTest() {
    VesselBranch branch;
    for (int k = 0; k <= 20; ++k) branch.points.push_back({{0, 0, 10.0 * k}, 4});
    const VesselTree tree({branch}, "tube");
    models_ = instruments_named({"microcatheter-27f"});
    instruments_.emplace(tree, models_, most_inferior_end(tree));
    report_.emplace(*instruments_);
  }

  /// To a pose at a steady rate in some time.
  void go(double insertion_mm, double rotation_rad, double time_s) {
    const HubPose from = instruments_->pose(0);
    const int steps = static_cast<int>(std::lround(1000 * time_s));
    for (int k = 1; k <= steps; ++k) {
      const double share = static_cast<double>(k) / steps;
      const std::vector<HubPose> poses{{std::lerp(from.insertion_mm, insertion_mm, share),
                                        std::lerp(from.rotation_rad, rotation_rad, share)}};
      instruments_->step(poses);
      report_->add(*instruments_);
    }
  }

  const InstrumentFigures& figures() const { return report_->figures().instruments.front(); }

  std::vector<InstrumentModel> models_;
  std::optional<Instruments> instruments_;
  std::optional<RunReport> report_;
};

TEST_F(RunReportTest, CountsTimeFromTheFirstMotionOn) {
  go(0, 0, 0.5);
  EXPECT_EQ(report_->figures().time_s, 0);
  go(20, 0, 0.5);
  go(20, 0, 0.3);
  EXPECT_NEAR(report_->figures().time_s, 0.8, 0.002);
  EXPECT_NEAR(report_->figures().idle_s, 0.3, 0.002);
}

TEST_F(RunReportTest, AddsUpTheTipsPathAndTheHubsTurns) {
  go(60, 1, 1);
  go(30, -1, 1);
  go(80, 0, 1);
  // Counted in pieces of half a millimetre, of which the last is missing; a tip lags behind its hub a little.
  EXPECT_NEAR(figures().path_mm, 60 + 30 + 50, 4);
  EXPECT_NEAR(figures().turned_rad, 1 + 2 + 1, 1e-9);
  EXPECT_EQ(figures().reversals, 2);
}

TEST_F(RunReportTest, PassesOverATremblingHand) {
  go(30, 0, 0.5);
  for (int k = 0; k < 10; ++k) go(k % 2 == 0 ? 29.4 : 30, 0, 0.05);
  EXPECT_EQ(figures().reversals, 0);
  go(28, 0, 0.1);
  EXPECT_EQ(figures().reversals, 1);
}

TEST_F(RunReportTest, HasTheLoadsOfTheRun) {
  double largest_N = 0, sum_N = 0, largest_Nm = 0;
  for (int k = 1; k <= 1000; ++k) {
    go(0.1 * k, 0.002 * k, 0.001);
    const HubLoad load = instruments_->load(0);
    largest_N = std::max(largest_N, std::abs(load.force_N));
    largest_Nm = std::max(largest_Nm, std::abs(load.torque_Nm));
    sum_N += std::abs(load.force_N);
  }
  EXPECT_EQ(figures().largest_N, largest_N);
  EXPECT_EQ(figures().largest_Nm, largest_Nm);
  EXPECT_NEAR(figures().mean_N, sum_N / 1000, 1e-12);
  EXPECT_GE(figures().largest_wall_N, 0);
  EXPECT_GE(figures().wall_impulse_Ns, 0);
}

TEST_F(RunReportTest, CountsTheTimeOfEachHub) {
  go(30, 0, 0.5);
  go(30, 1, 0.4);
  go(30, 1, 0.3);
  EXPECT_NEAR(figures().idle_s, 0.3, 0.002);
  EXPECT_EQ(figures().turn_backs, 0);
  go(30, 0.8, 0.1);
  EXPECT_EQ(figures().turn_backs, 1);
}

TEST_F(RunReportTest, HasValuesOverTime) {
  go(50, 0, 1.1);
  const RunSeries& series = report_->series();
  ASSERT_EQ(series.time_s.size(), 6);
  EXPECT_NEAR(series.time_s[5], 1, 1e-9);
  EXPECT_NEAR(series.instruments[0].insertion_mm[5], 50 / 1.1, 0.1);
  EXPECT_EQ(series.instruments[0].wall_N.size(), 6);
}

TEST_F(RunReportTest, GoesOnAfterAnExchange) {
  go(20, 0, 0.5);
  go(0, 0, 0.5);
  const double path_mm = figures().path_mm;
  instruments_->exchange(0, InstrumentModel::named("microcatheter-24f"));
  report_->exchanged(0, *instruments_);
  go(20, 0, 0.5);
  EXPECT_EQ(figures().exchanges, 1);
  EXPECT_NEAR(figures().path_mm, path_mm + 20, 1);
}

}  // namespace
}  // namespace xraycast::run_report_test
