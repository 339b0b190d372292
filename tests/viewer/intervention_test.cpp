#include "xraycast/serving/intervention.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/scene/catheter_surface.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

namespace xraycast::intervention_test {
namespace {

class AtTheTable : public testing::Test {
 protected:
  RunRequest run_of(const std::vector<std::string>& instruments) const {
    return {.tree = tree_, .instruments = instruments_named(instruments)};
  }

  Intervention begin() { return Intervention({.run = run_of({"cobra-5f"})}); }

  /// Frames of a tenth of a second, as far as the clock of the pedal goes.
  static void watch(Intervention& intervention, const CArmPose& pose, int frames) {
    for (int i = 0; i < frames; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      intervention.update(pose, 0.1);
    }
  }

  TemporaryFolder folder_;
  std::shared_ptr<const VesselTree> tree_ =
      std::make_shared<const VesselTree>(make_phantom("thorax").vessel_branches(), "thorax");
};

TEST_F(AtTheTable, OnlyThePedalExposes) {
  Intervention intervention = begin();
  intervention.update({}, 0.1);
  ASSERT_EQ(intervention.exposures(), 1) << "the first picture is for free";
  const auto held = intervention.surfaces()[0].mesh.points_mm;

  CArmPose moved;
  moved.rotate(30);
  intervention.manual()->set_rates(100, 0);
  watch(intervention, moved, 10);
  EXPECT_EQ(intervention.exposures(), 1);
  EXPECT_EQ(intervention.pose(), CArmPose{}) << "the last image is held";
  EXPECT_EQ(intervention.caption({}), status_of({}));
  EXPECT_EQ(intervention.caption(moved), "held: " + status_of({}) + "; C-arm: " + status_of(moved));
  EXPECT_EQ(intervention.surfaces()[0].mesh.points_mm, held);
  EXPECT_EQ(intervention.fluoroscopy_s(), 0);
  EXPECT_GT(intervention.run().now().pose.insertion_mm, 1) << "though the catheter moves";

  intervention.press_pedal(true);
  watch(intervention, moved, 5);
  EXPECT_EQ(intervention.exposures(), 6);
  EXPECT_EQ(intervention.pose(), moved);
  EXPECT_EQ(intervention.caption(moved), status_of(moved));
  EXPECT_NE(intervention.surfaces()[0].mesh.points_mm, held);
  EXPECT_NEAR(intervention.fluoroscopy_s(), 0.5, 1e-9);
  intervention.press_pedal(false);
  watch(intervention, {}, 3);
  EXPECT_EQ(intervention.exposures(), 6);
  EXPECT_NEAR(intervention.fluoroscopy_s(), 0.5, 1e-9);
}

TEST_F(AtTheTable, ANewRunIsShown) {
  Intervention intervention = begin();
  intervention.update({}, 0.1);
  const long before = intervention.exposures();
  intervention.restart();
  intervention.update({}, 0.1);
  EXPECT_NE(intervention.exposures(), before) << "by which a viewer knows that there is another picture";
}

TEST_F(AtTheTable, AReplayIsSteeredByItsFileAndTheNextRunByHandAgain) {
  Intervention intervention = begin();
  const auto file = folder_ / "run.csv";
  write_whole_file(file, "time_s,insertion_mm,rotation_deg\n0,0,0\n0.3,36,0\n");
  intervention.replay(file);
  EXPECT_EQ(intervention.manual(), nullptr);
  while (intervention.run().now().time_s < 0.5) watch(intervention, {}, 1);
  EXPECT_NEAR(intervention.run().now().pose.insertion_mm, 36, 1e-9) << "a script leads the hub itself";
  intervention.restart();
  EXPECT_NE(intervention.manual(), nullptr);
  EXPECT_LT(intervention.run().now().pose.insertion_mm, 1);
}

TEST_F(AtTheTable, TheHandHoldsOneHubAfterTheOther) {
  Intervention intervention({.run = run_of({"cobra-5f", "guidewire-035-angled"})});
  intervention.hold_next_hub();
  EXPECT_EQ(intervention.held_hub(), 1u);
  intervention.manual()->set_rates(100, 0);
  while (intervention.run().now().time_s < 0.5) watch(intervention, {}, 1);
  EXPECT_LT(intervention.run().now().pose.insertion_mm, 1e-3) << "but for what the wire drags along";
  EXPECT_GT(intervention.run().now().instrument(1).pose.insertion_mm, 10);
  intervention.run().lock_valve(true);
  watch(intervention, {}, 20);
  EXPECT_GT(intervention.run().now().pose.insertion_mm, 1) << "the wire takes the catheter along";
  intervention.hold_next_hub();
  EXPECT_EQ(intervention.held_hub(), 0u);
}

TEST_F(AtTheTable, ASessionKeepsEveryInstrument) {
  Intervention intervention({.run = run_of({"cobra-5f", "guidewire-035-angled"})});
  intervention.update({}, 0.1);
  const SteeredInstruments kept = intervention.steered();
  ASSERT_EQ(kept.instruments.size(), 2u);
  EXPECT_TRUE(kept.instruments[0].has_lumen);
  EXPECT_FALSE(kept.instruments[1].has_lumen);
  // The catheter, the wire's shaft and its tip, as they are drawn now.
  const std::vector<Surface> again = steered_surfaces(kept);
  ASSERT_EQ(again.size(), 3u);
  for (std::size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].mesh.points_mm, intervention.surfaces()[i].mesh.points_mm);
    EXPECT_EQ(again[i].mu_per_mm, intervention.surfaces()[i].mu_per_mm);
  }
}

TEST_F(AtTheTable, OnlyAHandOnSeveralInstrumentsHasAValve) {
  Intervention alone = begin();
  alone.toggle_valve();
  EXPECT_FALSE(alone.run().is_valve_locked());
  Intervention pair({.run = run_of({"cobra-5f", "guidewire-035-angled"})});
  pair.toggle_valve();
  EXPECT_TRUE(pair.run().is_valve_locked());
  const auto file = folder_ / "run.csv";
  write_whole_file(file, "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n");
  pair.replay(file);
  pair.toggle_valve();
  pair.hold_next_hub();
  EXPECT_FALSE(pair.run().is_valve_locked()) << "a script leads each hub itself";
  EXPECT_EQ(pair.held_hub(), 0u);
}

TEST_F(AtTheTable, OverANetworkTheHandChoosesWhichHubLeads) {
  Intervention intervention({.run = run_of({"cobra-5f", "guidewire-035-angled"}),
                             .haptic = "openigtlink",
                             .listen = "127.0.0.1:0"});
  intervention.hold_next_hub();
  EXPECT_EQ(intervention.held_hub(), 1u);
}

TEST_F(AtTheTable, ExchangesAnInstrumentThatIsDrawnBack) {
  Intervention intervention({.run = run_of({"guide-6f", "guidewire-035-j"})});
  const InstrumentModel wire = InstrumentModel::named("guidewire-035-j");
  const InstrumentModel microcatheter = InstrumentModel::named("microcatheter-27f");
  const auto inner = [&] { return intervention.run().models()[1].name(); };
  const auto exchange_for = [&](const InstrumentModel& instrument) {
    intervention.exchange(1, instrument);
    // A loaded machine takes its time.
    for (int i = 0; i < 500 && inner() != instrument.name(); ++i) watch(intervention, {}, 1);
    return inner();
  };
  intervention.update({}, 0.1);
  EXPECT_EQ(intervention.surfaces().size(), 5u) << "catheter and wire with a marker each, the contrast agent";
  EXPECT_EQ(exchange_for(microcatheter), "microcatheter-27f");
  EXPECT_EQ(intervention.steered().instruments[1].radius_mm, wire.radius_mm()) << "the last image is held";
  intervention.press_pedal(true);
  watch(intervention, {}, 1);
  EXPECT_EQ(intervention.surfaces().size(), 5u);
  EXPECT_EQ(intervention.steered().instruments[1].radius_mm, microcatheter.radius_mm());
  EXPECT_TRUE(intervention.steered().instruments[1].has_lumen);

  intervention.hold_next_hub();
  intervention.manual()->set_rates(100, 50);
  while (intervention.run().now().instrument(1).pose.insertion_mm < 5) watch(intervention, {}, 1);
  intervention.manual()->set_rates(0, 0);
  intervention.exchange(1, wire);
  EXPECT_EQ(intervention.note_on_exchange(1), "draw it back to 0 mm to exchange it");
  EXPECT_EQ(intervention.note_on_exchange(0), "");
  intervention.manual()->set_rates(-100, 0);
  while (!intervention.note_on_exchange(1).empty()) watch(intervention, {}, 1);
  EXPECT_EQ(inner(), "microcatheter-27f") << "what was refused is not made later";
  intervention.run().start_recording();
  intervention.exchange(1, wire);
  EXPECT_EQ(intervention.note_on_exchange(1), "stop the recording to exchange it");
  const auto file = folder_ / "run.csv";
  write_whole_file(file, intervention.run().stop_recording());
  const std::vector<InstrumentModel> recorded = intervention.run().models();
  EXPECT_EQ(exchange_for(wire), "guidewire-035-j");
  watch(intervention, {}, 2);
  EXPECT_NEAR(intervention.run().now().instrument(1).pose.rotation_rad, 0, 1e-3) << "the hand begins anew";
  intervention.exchange(1, InstrumentModel::named("guide-6f"));
  while (intervention.note_on_exchange(1).empty()) watch(intervention, {}, 1);
  EXPECT_NE(intervention.note_on_exchange(1).find("guide-6f"), std::string::npos) << "it is too thick";

  intervention.restart();
  EXPECT_EQ(inner(), "guidewire-035-j");
  intervention.replay(file, recorded);
  EXPECT_EQ(inner(), "microcatheter-27f") << "a recording is of the instruments that it was made with";
}

TEST_F(AtTheTable, AnExerciseIsCountedAndBeginsWithEachRun) {
  const auto file = folder_ / "e.json";
  write_whole_file(file, R"({"title": "In", "task": "Go in.", "instruments": ["cobra-5f"],
    "devices": ["vertebral-5f"], "entry": [89, -54, -357], "targets": [{"at_mm": [88, -58, -325]}], "limits": {"fluoroscopy_s": 0.3}})");
  const Exercise exercise = read_exercise(file, *tree_);
  EXPECT_THROW(Intervention({.run = run_of({"simmons2-5f"}), .exercise = exercise}), InputError);
  Intervention intervention({.run = run_of({"cobra-5f"}), .exercise = exercise});
  std::vector<std::string> choices;
  for (const InstrumentModel& choice : intervention.choices()) choices.push_back(choice.name());
  EXPECT_EQ(choices, (std::vector<std::string>{"cobra-5f", "vertebral-5f"}));
  const auto state = [&] { return *intervention.run().monitor().state(); };
  EXPECT_EQ(state().reached(), 0);

  intervention.count_generator({.exposures = 7, .air_kerma_mGy = 2});
  intervention.press_pedal(true);
  intervention.manual()->set_rates(100, 0);
  watch(intervention, {}, 10);
  const auto json = nlohmann::json::parse(intervention.run().monitor().json(true));
  EXPECT_GT(json["instruments"][0]["tip_path_mm"], 5);
  EXPECT_EQ(json["exposures"], 7);
  EXPECT_NEAR(json["fluoroscopy_s"], 1, 0.11);
  EXPECT_TRUE(state().limits[0].passed_s);

  intervention.manual()->set_rates(0, 0);
  intervention.restart();
  watch(intervention, {}, 2);
  EXPECT_FALSE(state().limits[0].passed_s) << "the time before is that of another run";
  const auto again = nlohmann::json::parse(intervention.run().monitor().json(false));
  EXPECT_EQ(again["exposures"], 0);
  EXPECT_EQ(again["air_kerma_mGy"], 0);
}

TEST_F(AtTheTable, TheReportNamesAnExchange) {
  Intervention intervention({.run = run_of({"guide-6f", "guidewire-035-j"})});
  intervention.exchange(1, InstrumentModel::named("microcatheter-27f"));
  for (int i = 0; i < 500 && intervention.run().now().exchanges == 0; ++i) watch(intervention, {}, 1);
  const auto report = nlohmann::json::parse(intervention.run().monitor().json(false));
  EXPECT_EQ(report["instruments"][1]["name"], "microcatheter-27f");
  EXPECT_EQ(report["instruments"][1]["exchanges"], 1);
  EXPECT_FALSE(intervention.run().monitor().state());
}

TEST_F(AtTheTable, AReplayThatCannotBeReadLeavesTheRun) {
  Intervention intervention = begin();
  intervention.run().start_recording();
  const SimulatedRun* run = &intervention.run();
  EXPECT_THROW(intervention.replay(folder_ / "missing.csv"), InputError);
  write_whole_file(folder_ / "empty.csv", "time_s,insertion_mm,rotation_deg\n");
  EXPECT_THROW(intervention.replay(folder_ / "empty.csv"), InputError);
  EXPECT_EQ(&intervention.run(), run);
  EXPECT_TRUE(intervention.run().is_recording());
  watch(intervention, {}, 1);
}

TEST_F(AtTheTable, SaysWhatCannotBeSteered) {
  EXPECT_THROW(Intervention({}), InputError);
  RunRequest nowhere = run_of({"cobra-5f"});
  nowhere.entry.end = 1000;
  EXPECT_THROW(Intervention({.run = nowhere}), InputError);
  EXPECT_THROW(Intervention({.run = run_of({"cobra-5f"}), .haptic = "glove"}), InputError);
  EXPECT_THROW(Intervention({.run = run_of({"guidewire-035-angled", "cobra-5f"})}), InputError);
}

TEST_F(AtTheTable, TheRoadMapIsTheVesselsOutlineOfAView) {
  Intervention intervention = begin();
  const View view{.centre_mm = {0, 0, 0}, .width = 300, .height = 400, .pixel_mm = 2};
  const auto outline = intervention.road_map(view);
  ASSERT_FALSE(outline.empty());
  for (const glm::ivec2& pixel : outline)
    EXPECT_TRUE(pixel.x >= 0 && pixel.y >= 0 && pixel.x < view.width && pixel.y < view.height);
  View below = view;
  below.centre_mm.z += 2;
  const std::vector<glm::ivec2> before(outline.begin(), outline.end());
  const auto after = intervention.road_map(below);
  // A picture's centre 2 mm higher shows all one pixel lower, but for what leaves it.
  std::size_t same = 0;
  for (const glm::ivec2& pixel : before)
    same += static_cast<std::size_t>(std::ranges::count(after, pixel + glm::ivec2(0, 1)));
  EXPECT_GT(same, before.size() * 9 / 10);
  intervention.show_road_map(false);
  EXPECT_TRUE(intervention.road_map(view).empty());
}

TEST_F(AtTheTable, TheRoadMapStaysAsItWasTakenAndShowsWhatIsTreatedOnceItIsTakenAnew) {
  VesselBranch narrow;
  for (int i = 0; i <= 100; ++i) narrow.points.push_back({{0, 0, 2.0 * i}, 2});
  RunRequest run = run_of({"balloon-6x20"});
  run.tree = std::make_shared<const VesselTree>(std::vector{narrow}, "narrow");
  run.script = Script::parse(
      "time_s,insertion_mm,rotation_deg,inflation_bar\n0,0,0,0\n1.2,120,0,0\n2.1,120,0,9\n2.3,120,0,9\n",
      "test");
  Intervention intervention({.run = run});
  const auto outline_of = [&](const View& view) {
    const auto outline = intervention.road_map(view);
    return std::vector<glm::ivec2>(outline.begin(), outline.end());
  };
  const CArmPose pose;
  while (intervention.run().now().instrument(0).balloon_bar < 8.9) watch(intervention, pose, 1);
  const View view{.centre_mm = intervention.run().now().instrument(0).tip.position_mm,
                  .width = 400,
                  .height = 400,
                  .pixel_mm = 0.1};
  const std::vector<glm::ivec2> before = outline_of(view);
  ASSERT_GT(before.size(), 100U);
  watch(intervention, pose, 2);
  EXPECT_EQ(outline_of(view), before);
  intervention.show_road_map(false);
  intervention.show_road_map(true);
  const std::vector<glm::ivec2> after = outline_of(view);
  std::size_t same = 0;
  for (const glm::ivec2& pixel : before) same += static_cast<std::size_t>(std::ranges::count(after, pixel));
  EXPECT_LT(same, before.size()) << "the vessel is wider about the balloon";
  EXPECT_GT(same, before.size() / 4) << "and as it was elsewhere";
}

}  // namespace
}  // namespace xraycast::intervention_test
