#include "xraycast/simulation/simulation_loop.hpp"

#include "xraycast/base/stopwatch.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>

namespace xraycast::simulation_loop_test {
namespace {

using namespace std::chrono_literals;

std::unique_ptr<Catheter> catheter() {
  const VesselTree tree(make_phantom("thorax").vessel_branches(), "thorax");
  return std::make_unique<Catheter>(tree, InstrumentModel::named("cobra-5f"), most_inferior_end(tree));
}

TEST(SimulationLoop, SnapshotsAreOfOneMoment) {
  // The hand pushes at 50 mm/s; what belongs together must fit together, whenever it is read.
  double pushed_mm = 0;
  SimulationLoop loop(catheter(), [&pushed_mm](const HubPose&, const HubLoad& load, double step_s) {
    EXPECT_TRUE(std::isfinite(load.force_N));
    return HubPose{pushed_mm += 50 * step_s, 0};
  });
  double before_s = -1;
  const auto end = std::chrono::steady_clock::now() + 500ms;
  int read = 0;
  while (std::chrono::steady_clock::now() < end) {
    const CatheterSnapshot& now = loop.snapshot();
    ASSERT_GE(now.time_s, before_s);
    // 50 mm/s times the time, to rounding.
    ASSERT_NEAR(now.pose.insertion_mm, 50 * now.time_s, 1e-6);
    ASSERT_EQ(now.nodes_mm.back(), now.tip.position_mm);
    if (now.time_s > before_s) ++read;
    before_s = now.time_s;
  }
  EXPECT_GT(read, 20);
}

TEST(SimulationLoop, GoesOnWhileNobodyReads) {
  SimulationLoop loop(catheter(), [](const HubPose&, const HubLoad&, double) { return HubPose{20, 0}; });
  const Stopwatch waiting;
  const double start_s = loop.snapshot().time_s;
  std::this_thread::sleep_for(1s);
  const CatheterSnapshot& now = loop.snapshot();
  // A busy machine may delay it, and this thread's waking too; a tenth of a second is made up for.
  EXPECT_GT(now.time_s - start_s, 0.3);
  EXPECT_LT(now.time_s - start_s, 1e-3 * waiting.ms() + 0.3);
  EXPECT_GT(now.timing.steps, 300);
  EXPECT_GT(now.timing.mean_ms, 0);
  EXPECT_GE(now.timing.p999_ms, now.timing.mean_ms);
  EXPECT_LE(now.timing.missed, now.timing.steps);
}

TEST(SimulationLoop, HandsOnWhatItsThreadThrew) {
  SimulationLoop loop(catheter(), [](const HubPose&, const HubLoad&, double) -> HubPose {
    throw std::runtime_error("the hand let go");
  });
  EXPECT_THAT(
      [&] {
        for (const Stopwatch waiting; waiting.ms() < 30e3; std::this_thread::sleep_for(1ms)) loop.snapshot();
      },
      testing::ThrowsMessage<std::runtime_error>("the hand let go"));
}

}  // namespace
}  // namespace xraycast::simulation_loop_test
