#include "xraycast/serving/simulated_run.hpp"

#include "support/basilar_tip.hpp"
#include "xraycast/catheter/lumen_profile.hpp"
#include "xraycast/haptics/manual_device.hpp"
#include "xraycast/haptics/script_device.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/simulation/script.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <numbers>
#include <thread>

namespace xraycast::simulated_run_test {
namespace {

SimulatedRun run_with(std::unique_ptr<HapticDevice> device,
                      const std::vector<std::string>& instruments = {"cobra-5f"}) {
  auto tree = std::make_shared<const VesselTree>(make_phantom("thorax").vessel_branches(), "thorax");
  return {{.tree = std::move(tree), .instruments = instruments_named(instruments)}, std::move(device)};
}

/// Updates as a window does, until the simulation's clock has gone on by `time_s`.
void watch(SimulatedRun& run, double time_s) {
  const double end_s = run.now().time_s + time_s;
  while (run.now().time_s < end_s) {
    run.update();
    std::this_thread::sleep_for(std::chrono::milliseconds(15));
  }
}

TEST(ManualDevice, IntegratesRatesAndDoesNotLeaveTheIntroducer) {
  ManualDevice device("keyboard");
  device.set_rates(20, 1);
  for (int i = 0; i < 999; ++i) device.pose(0);
  EXPECT_NEAR(device.pose(0).pose.insertion_mm, 20, 1e-9);
  EXPECT_NEAR(device.pose(0).pose.rotation_rad, 1.001, 1e-9);
  device.set_rates(0, 0);
  device.move_by(-100, 0);
  EXPECT_EQ(device.pose(0).pose.insertion_mm, 0);
  device.move_by(3, 0);
  EXPECT_NEAR(device.pose(0).pose.insertion_mm, 3, 1e-9) << "what was pulled in vain does not count";
}

TEST(SimulatedRun, IsPushedAndFillsTheTreeWithContrast) {
  auto device = std::make_unique<ManualDevice>("keyboard");
  ManualDevice& hand = *device;
  SimulatedRun run = run_with(std::move(device));
  hand.set_rates(100, 0);
  watch(run, 0.5);
  hand.set_rates(0, 0);
  run.inject(5);
  watch(run, 0.3);
  EXPECT_GT(run.now().pose.insertion_mm, 30);
  EXPECT_NEAR(run.injected_ml(), 1.5, 0.3) << "0.3 s, to a frame or two of a busy machine";
  const Surface catheter = run.instruments()[0], contrast = run.contrast();
  EXPECT_GT(volume_mm3(catheter.mesh), 0);
  ASSERT_FALSE(contrast.mu_weights.empty());
  // 350 mg/ml, diluted by blood.
  EXPECT_GT(std::ranges::max(contrast.mu_weights), 10);
  EXPECT_LT(std::ranges::max(contrast.mu_weights), 350);
  EXPECT_GT(run.loads().size(), 10u);
}

TEST(SimulatedRun, RecordsAScriptThatCanBeRunAgain) {
  const Script script = Script::parse("time_s,insertion_mm,rotation_deg\n0,0,0\n0.5,40,90\n", "test");
  SimulatedRun run = run_with(std::make_unique<ScriptDevice>(script));
  run.start_recording();
  watch(run, 0.8);
  const Script recorded = Script::parse(run.stop_recording(), "recording");
  EXPECT_EQ(recorded.rows().front().time_s, 0);
  // A script leads the hub itself, with no spring between.
  EXPECT_NEAR(recorded.rows().back().pose.insertion_mm, 40, 1e-4);
  EXPECT_NEAR(recorded.rows().back().pose.rotation_rad, std::numbers::pi / 2, 1e-5);
}

TEST(SimulatedRun, EachInstrumentHasItsHubSurfaceAndColumns) {
  const std::string rows =
      "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n0.5,20,0,60,90\n";
  SimulatedRun run = run_with(std::make_unique<ScriptDevice>(Script::parse(rows, "test", 2)),
                              {"cobra-5f", "guidewire-035-angled"});
  run.start_recording();
  watch(run, 0.8);
  const Script recorded = Script::parse(run.stop_recording(), "recording", 2);
  EXPECT_NEAR(recorded.rows().back().pose.insertion_mm, 20, 1e-4);
  EXPECT_NEAR(recorded.rows().back().pose_of(1).insertion_mm, 60, 1e-4);
  EXPECT_NEAR(recorded.rows().back().pose_of(1).rotation_rad, std::numbers::pi / 2, 1e-5);
  // The catheter, the wire's shaft, and its tip.
  const std::vector<Surface> surfaces = run.instruments();
  ASSERT_EQ(surfaces.size(), 3u);
  EXPECT_GT(surfaces[2].mu_per_mm, 1.5 * surfaces[1].mu_per_mm) << "the tip is denser";
  for (const Surface& surface : surfaces) EXPECT_GT(volume_mm3(surface.mesh), 0);
  // The wire lies in the catheter's lumen, through which no contrast agent can come.
  run.inject(5);
  watch(run, 0.2);
  EXPECT_EQ(run.injected_ml(), 0);
}

TEST(SimulatedRun, ABalloonOpensItsVesselAndLeavesItsStent) {
  VesselBranch branch;
  for (int i = 0; i <= 120; ++i) branch.points.push_back({{0, 0, 1.0 * i}, 2.5});
  auto device = std::make_unique<ManualDevice>("keyboard");
  ManualDevice& hand = *device;
  SimulatedRun run({.tree = std::make_shared<const VesselTree>(std::vector{branch}, "tube"),
                    .instruments = instruments_named({"stent-6x18"}),
                    .entry = {glm::dvec3(0)}},
                   std::move(device));
  run.start_recording();
  hand.set_rates(100, 0);
  watch(run, 0.7);
  hand.set_rates(0, 0);
  // The catheter, two markers, the balloon, which is folded, and the stent's 7 rings and 18 links.
  ASSERT_EQ(run.instruments().size(), 4u + 25);
  EXPECT_TRUE(run.instruments()[3].mesh.points_mm.empty());
  EXPECT_EQ(run.now().treated, nullptr);
  const auto watch_until = [&](double bar) {
    // A loaded machine takes its time.
    for (int i = 0; i < 200 && run.now().balloon_bar != bar; ++i) watch(run, 0.1);
    watch(run, 0.1);
  };
  run.inflate(0, 8);
  watch_until(8);
  EXPECT_EQ(run.now().balloon_bar, 8);
  EXPECT_FALSE(run.instruments()[3].mesh.points_mm.empty());
  run.inflate(0, 0);
  watch_until(0);
  EXPECT_EQ(run.now().balloon_bar, 0);
  EXPECT_EQ(run.now().carried_rings, 0);
  ASSERT_NE(run.now().treated, nullptr);
  ASSERT_EQ(run.now().treated->stents.size(), 1u);
  const PlacedStent& stent = run.now().treated->stents[0];
  EXPECT_NEAR(radius_mm(*run.now().treated->walls.field(), 0, stent.middle_mm), 2.95, 1e-9);
  EXPECT_EQ(run.instruments().size(), 4u + 25) << "of the stent that was left";
  const Script recorded = Script::parse(run.stop_recording(), "recording");
  EXPECT_EQ(
      std::ranges::max(recorded.rows(), {}, [](const Script::Row& row) { return row.pose.inflation_bar; })
          .pose.inflation_bar,
      8);
}

TEST(SimulatedRun, ASheathIsDrawnBackFromItsStent) {
  VesselBranch branch;
  for (int i = 0; i <= 120; ++i) branch.points.push_back({{0, 0, 1.0 * i}, 3.5});
  auto device = std::make_unique<ManualDevice>("keyboard");
  ManualDevice& hand = *device;
  SimulatedRun run({.tree = std::make_shared<const VesselTree>(std::vector{branch}, "tube"),
                    .instruments = instruments_named({"stent-self-8x40"}),
                    .entry = {glm::dvec3(0)}},
                   std::move(device));
  run.start_recording();
  hand.set_rates(100, 0);
  watch(run, 0.9);
  hand.set_rates(0, 0);
  EXPECT_EQ(run.now().carried_rings, 16);
  run.draw_sheath(0, 100);
  watch(run, 1.2);
  EXPECT_EQ(run.now().carried_rings, 0);
  ASSERT_NE(run.now().treated, nullptr);
  ASSERT_EQ(run.now().treated->stents.size(), 1u);
  EXPECT_EQ(run.now().treated->stents[0].radii_mm.size(), 16u);
  // The catheter, its markers, and the stent in the vessel.
  EXPECT_EQ(run.instruments().size(), 1u + 3 + 16 + 15 * 4);
  const Script recorded = Script::parse(run.stop_recording(), "recording");
  EXPECT_NEAR(recorded.rows().back().pose.release_mm, run.models()[0].max_release_mm(), 1e-4)
      << "no further than the stent";
}

TEST(SimulatedRun, ACoilIsDetachedInAnAneurysm) {
  auto device = std::make_unique<ManualDevice>("keyboard");
  ManualDevice& hand = *device;
  SimulatedRun run({.tree = std::make_shared<const VesselTree>(test::basilar_tip()),
                    .instruments = instruments_named({"microcatheter-24f", "coil-10x30"}),
                    .entry = {glm::dvec3(0)}},
                   std::move(device));
  run.start_recording();
  const auto advance_until = [&](std::size_t hub, const auto& is_there) {
    hand.hold(hub);
    hand.set_rates(100, 0);
    // A busy machine's clock may run slower than a hand's.
    for (int i = 0; i < 400 && !is_there(); ++i) watch(run, 0.02);
    hand.set_rates(0, 0);
    watch(run, 0.1);
  };
  advance_until(0, [&] { return run.now().pose.insertion_mm > 103; });
  const std::size_t before = run.instruments().size();
  run.detach(1);
  watch(run, 0.1);
  EXPECT_TRUE(run.now().instrument(1).coil) << "it is in the catheter still";
  advance_until(1, [&] { return run.now().instrument(1).coil->can_be_detached(); });
  ASSERT_NE(run.now().coiled, nullptr);
  EXPECT_NEAR(run.now().instrument(1).coil->laid_mm, 300, PushedCoil::kSlack_mm);
  EXPECT_EQ(run.instruments().size(), before + 1)
      << "the coil in the sac, besides what is left of it in the catheter";
  run.detach(1);
  watch(run, 0.1);
  EXPECT_FALSE(run.now().instrument(1).coil);
  ASSERT_EQ(run.now().coiled->size(), 1u);
  EXPECT_TRUE((*run.now().coiled)[0].coils.at(0).is_detached);
  EXPECT_NEAR((*run.now().coiled)[0].packing, 0.059, 1e-3);
  EXPECT_GT(volume_mm3(run.instruments().back().mesh), 0);
  const Script recorded = Script::parse(run.stop_recording(), "recording", 2);
  EXPECT_EQ(recorded.rows().back().pose_of(1).detach, 2) << "once in vain";
}

TEST(SimulatedRun, AReplayEndsWhereTheRecordingEnded) {
  auto device = std::make_unique<ManualDevice>("keyboard");
  ManualDevice& hand = *device;
  SimulatedRun run = run_with(std::move(device));
  run.start_recording();
  hand.set_rates(100, 2);
  watch(run, 0.8);
  hand.set_rates(0, 0);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // the window draws no frame meanwhile
  const std::string csv = run.stop_recording();
  const CatheterSnapshot ended = run.now();
  const Script recorded = Script::parse(csv, "recording");
  // To the digits of the file. The spring between hand and hub is stretched by what the vessels bear.
  constexpr double kWritten_mm = 1e-4, kWritten_rad = 2e-6;
  EXPECT_NEAR(recorded.rows().back().pose.insertion_mm, ended.pose.insertion_mm, kWritten_mm);
  EXPECT_NEAR(recorded.rows().back().pose.rotation_rad, ended.pose.rotation_rad, kWritten_rad);

  SimulatedRun again = run_with(std::make_unique<ScriptDevice>(recorded));
  watch(again, recorded.rows().back().time_s + 0.3);
  EXPECT_NEAR(again.now().pose.insertion_mm, ended.pose.insertion_mm, kWritten_mm);
  EXPECT_NEAR(again.now().pose.rotation_rad, ended.pose.rotation_rad, kWritten_rad);
}

}  // namespace
}  // namespace xraycast::simulated_run_test
