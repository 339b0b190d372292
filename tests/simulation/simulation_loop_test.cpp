#include "xraycast/simulation/simulation_loop.hpp"

#include "xraycast/base/stopwatch.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace xraycast::simulation_loop_test {
namespace {

using namespace std::chrono_literals;

using Hubs = std::span<const HubPose>;
using Loads = std::span<const HubLoad>;

std::unique_ptr<Instruments> instruments(const std::vector<std::string>& names = {"cobra-5f"}) {
  const VesselTree tree(make_phantom("thorax").vessel_branches(), "thorax");
  std::vector<InstrumentModel> models;
  for (const std::string& name : names) models.push_back(InstrumentModel::named(name));
  return std::make_unique<Instruments>(tree, models, most_inferior_end(tree));
}

TEST(SimulationLoop, SnapshotsAreOfOneMoment) {
  // The hand pushes at 50 mm/s; what belongs together must fit together, whenever it is read.
  std::array<HubPose, 2> pushed;
  SimulationLoop loop(instruments({"cobra-5f", "guidewire-035-j"}),
                      [&pushed](Hubs hubs, Loads loads, double step_s) -> Hubs {
                        EXPECT_EQ(hubs.size(), 2u);
                        EXPECT_TRUE(std::isfinite(loads[0].force_N + loads[1].force_N));
                        pushed[0].insertion_mm += 50 * step_s;
                        pushed[1].insertion_mm += 80 * step_s;
                        return pushed;
                      });
  double before_s = -1;
  const auto end = std::chrono::steady_clock::now() + 500ms;
  int read = 0;
  while (std::chrono::steady_clock::now() < end) {
    const CatheterSnapshot& now = loop.snapshot();
    ASSERT_GE(now.time_s, before_s);
    // 50 mm/s times the time, to rounding.
    ASSERT_NEAR(now.pose.insertion_mm, 50 * now.time_s, 1e-6);
    ASSERT_NEAR(now.instrument(1).pose.insertion_mm, 80 * now.time_s, 1e-6);
    for (const std::size_t d : {0, 1})
      ASSERT_EQ(now.instrument(d).nodes_mm.back(), now.instrument(d).tip.position_mm);
    if (now.time_s > before_s) ++read;
    before_s = now.time_s;
  }
  EXPECT_GT(read, 20);
}

TEST(SimulationLoop, GoesOnWhileNobodyReads) {
  const HubPose in{20, 0};
  SimulationLoop loop(instruments(), [&in](Hubs, Loads, double) { return Hubs(&in, 1); });
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

/// A pair of hubs that the test moves while the loop runs.
struct Hand {
  std::atomic<double> inner_mm{0};
  std::array<HubPose, 2> poses;

  Hubs move() {
    poses[1].insertion_mm = inner_mm;
    return poses;
  }
};

template <typename Condition>
const CatheterSnapshot& wait_for(SimulationLoop& loop, const Condition& condition) {
  const Stopwatch waiting;
  while (waiting.ms() < 30e3 && !condition(loop.snapshot())) std::this_thread::sleep_for(1ms);
  return loop.snapshot();
}

TEST(SimulationLoop, ExchangesAnInstrumentThatIsDrawnBack) {
  Hand hand;
  std::atomic<double> new_radius_mm{0};
  SimulationLoop loop(
      instruments({"cobra-5f", "guidewire-035-j"}), [&hand](Hubs, Loads, double) { return hand.move(); },
      [&new_radius_mm](std::size_t instrument, const InstrumentModel& model) {
        EXPECT_EQ(instrument, 1u);
        new_radius_mm = model.radius_mm();
      });
  const auto before = loop.snapshot().instruments;
  const InstrumentModel microcatheter = InstrumentModel::named("microcatheter-27f");
  EXPECT_EQ(loop.snapshot().agent_outlet, 0u);
  loop.exchange(1, microcatheter);
  const CatheterSnapshot& now = wait_for(loop, [](const CatheterSnapshot& at) { return at.exchanges == 1; });
  ASSERT_EQ(now.exchanges, 1);
  EXPECT_EQ(now.refusal, nullptr);
  EXPECT_EQ((*now.instruments)[0].name(), "cobra-5f");
  EXPECT_EQ((*now.instruments)[1].name(), "microcatheter-27f");
  EXPECT_EQ(new_radius_mm, microcatheter.radius_mm());
  EXPECT_EQ((*before)[1].name(), "guidewire-035-j") << "what an older snapshot said holds for it";
  // The new one is steered.
  hand.inner_mm = 30;
  const auto is_in = [](const CatheterSnapshot& at) { return at.instrument(1).pose.insertion_mm > 29; };
  ASSERT_TRUE(is_in(wait_for(loop, is_in)));
  EXPECT_EQ(loop.snapshot().agent_outlet, 1u) << "the catheter's lumen is taken, the microcatheter's is free";
}

TEST(SimulationLoop, RefusesAnExchangeInOneLineAndGoesOn) {
  Hand hand;
  hand.inner_mm = 20;
  SimulationLoop loop(
      instruments({"cobra-5f", "guidewire-035-j"}), [&hand](Hubs, Loads, double) { return hand.move(); },
      [](std::size_t, const InstrumentModel&) { ADD_FAILURE() << "an exchange"; });
  wait_for(loop, [](const CatheterSnapshot& at) { return at.instrument(1).pose.insertion_mm > 10; });
  const auto instruments = loop.snapshot().instruments;
  const auto refusal_of = [&](const std::string& name) {
    const std::int64_t answered = loop.snapshot().exchanges;
    loop.exchange(1, InstrumentModel::named(name));
    return wait_for(loop, [&](const CatheterSnapshot& at) { return at.exchanges > answered; }).refusal;
  };
  const auto inserted = refusal_of("exchange-035-stiff");
  ASSERT_NE(inserted, nullptr);
  EXPECT_EQ(inserted->instrument, 1u);
  EXPECT_THAT(inserted->why, testing::HasSubstr("draw it back to 0"));
  EXPECT_THAT(inserted->why, testing::Not(testing::HasSubstr("\n")));
  hand.inner_mm = 0;
  wait_for(loop, [](const CatheterSnapshot& at) { return at.instrument(1).pose.insertion_mm == 0; });
  const auto thick = refusal_of("guide-6f");
  ASSERT_NE(thick, nullptr);
  EXPECT_THAT(thick->why, testing::HasSubstr("guide-6f"));
  EXPECT_EQ(loop.snapshot().instruments, instruments);
  const double then_s = loop.snapshot().time_s;
  const auto goes_on = [then_s](const CatheterSnapshot& at) { return at.time_s > then_s + 0.01; };
  EXPECT_TRUE(goes_on(wait_for(loop, goes_on)));
}

TEST(SimulationLoop, HandsOnWhatItsThreadThrew) {
  SimulationLoop loop(instruments(),
                      [](Hubs, Loads, double) -> Hubs { throw std::runtime_error("the hand let go"); });
  EXPECT_THAT(
      [&] {
        for (const Stopwatch waiting; waiting.ms() < 30e3; std::this_thread::sleep_for(1ms)) loop.snapshot();
      },
      testing::ThrowsMessage<std::runtime_error>("the hand let go"));
}

}  // namespace
}  // namespace xraycast::simulation_loop_test
