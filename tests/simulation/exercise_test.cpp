#include "xraycast/simulation/exercise.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <optional>

namespace xraycast::exercise_test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using Json = nlohmann::json;

/// A stem of 100 mm along z, from which "left arm" turns away to +x, and "right arm" goes straight on, of 60
/// mm each.
VesselTree fork() {
  std::vector<VesselBranch> branches(3);
  branches[0].name = "stem";
  branches[1].name = "left arm";
  branches[2].name = "right arm";
  for (int k = 0; k <= 20; ++k) branches[0].points.push_back({{0, 0, 5.0 * k}, 6});
  for (int k = 0; k <= 12; ++k) {
    branches[1].points.push_back({{3.0 * k, 0, 100 + 4.0 * k}, 5});
    branches[2].points.push_back({{0, 0, 100 + 5.0 * k}, 5});
  }
  branches[1].parent = branches[2].parent = 0;
  return {branches, "fork"};
}

Json usual() {
  return Json::parse(R"({"title": "Left arm", "task": "Go into the left arm.", "entry": "stem",
    "instruments": ["microcatheter-27f"], "targets": [{"vessel": "left arm", "depth_mm": 20}],
    "forbidden": ["right arm"], "limits": {"time_s": 60}})");
}

Exercise parsed(const Json& json) { return parse_exercise(json.dump(), "e.json", fork()); }

/// What is wrong with an exercise.
std::string message_of(const Json& json) {
  try {
    parsed(json);
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing";
}

TEST(Exercise, HasWhatItsFileSays) {
  const Exercise exercise = parsed(usual());
  EXPECT_EQ(exercise.title, "Left arm");
  EXPECT_EQ(exercise.instruments, std::vector<std::string>{"microcatheter-27f"});
  ASSERT_EQ(exercise.targets.size(), 1);
  EXPECT_EQ(exercise.targets[0].name, "left arm");
  EXPECT_EQ(exercise.targets[0].branches, std::vector<int>{1});
  EXPECT_EQ(exercise.targets[0].depth_mm, 20);
  EXPECT_EQ(exercise.forbidden[0].branches, std::vector<int>{2});
  EXPECT_EQ(exercise.limits.time_s, 60);
  EXPECT_FALSE(exercise.limits.force_N);
}

TEST(Exercise, StaysTheSameByNumbersOfBranches) {
  Json json = usual();
  json["targets"].push_back({{"at_mm", {0, 0, 50}}, {"radius_mm", 3}, {"instrument", 1}});
  const Exercise once = parsed(json), twice = parse_exercise(to_json(once), "e.json", fork());
  EXPECT_EQ(to_json(once), to_json(twice));
  EXPECT_EQ(twice.targets[0].name, "left arm");
  EXPECT_EQ(twice.targets[1].name, "place in stem");
  EXPECT_EQ(twice.targets[1].instrument, 0);
}

TEST(Exercise, SaysInALineWhatIsWrong) {
  const auto with = [](const char* pointer, const Json& value) {
    Json json = usual();
    json[Json::json_pointer(pointer)] = value;
    return message_of(json);
  };
  EXPECT_EQ(with("/limits/time_s", -5),
            "e.json: \"limits\": \"time_s\": is -5; it must be above 0 and at most 1e+06");
  EXPECT_EQ(
      with("/forbidden/0", "spleen"),
      "e.json: \"forbidden\"[0]: no branch of the tree has this name; it has left arm, right arm, stem");
  EXPECT_EQ(with("/targets/0/vessel", 7),
            "e.json: \"targets\"[0]: \"vessel\": there is no branch 7; the tree has 0 to 2");
  EXPECT_EQ(
      with("/targets/0/depth_mm", 70),
      "e.json: \"targets\"[0]: \"depth_mm\": is 70, but left arm ends 54 mm beyond its origin; give less");
  EXPECT_EQ(
      with("/targets/0", {{"at_mm", {40, 0, 50}}}),
      "e.json: \"targets\"[0]: \"at_mm\": lies 34 mm outside the vessels, the nearest of which is stem; "
      "give a place in one");
  EXPECT_EQ(with("/targets/0/instrument", 2),
            "e.json: \"targets\"[0]: \"instrument\": must be 1, for the outermost instrument, to 1");
  EXPECT_EQ(with("/targets", Json::array()), "e.json: \"targets\": is not a list of 1 to 100");
  EXPECT_EQ(with("/title", ""), "e.json: \"title\": has 0 bytes; give 1 to 80");
  EXPECT_EQ(
      with("/limit", Json::object()),
      "e.json: has no field \"limit\"; the fields are title, task, entry, instruments, devices, targets, "
      "forbidden, limits, reference");
  EXPECT_EQ(with("/targets/0/at_mm", {0, 0, 0}),
            "e.json: \"targets\"[0]: has either \"vessel\" or \"at_mm\"");
  EXPECT_THAT(message_of(Json::array()), StartsWith("e.json: is not an object"));
  EXPECT_THROW(parse_exercise("{", "e.json", fork()), InputError);
}

TEST(Exercise, NamesAnInstrumentThatThereIsNot) {
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) / "unknown-device.json";
  Json json = usual();
  json["devices"] = {"spaghetti"};
  write_whole_file(file, json.dump());
  try {
    read_exercise(file, fork());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("\"devices\"[0]: "));
    EXPECT_THAT(error.what(), HasSubstr("spaghetti"));
  }
}

TEST(Exercise, AllowsItsOwnInstrumentsAlone) {
  const Exercise exercise = parsed(usual());
  EXPECT_NO_THROW(check_allowed(exercise, instruments_named({"microcatheter-27f"})));
  EXPECT_THROW(check_allowed(exercise, instruments_named({"cobra-5f"})), InputError);
}

TEST(VesselDepth, BeginsAtTheWallOfTheVesselBefore) {
  const VesselDepth arm(fork(), {1}), both(fork(), {0, 1});
  EXPECT_EQ(arm.of_mm(1, 10), 4.0);  // the stem's radius is 6 mm
  EXPECT_EQ(arm.of_mm(0, 10), std::nullopt);
  EXPECT_EQ(both.of_mm(1, 10), 110.0);
}

/// Instruments that are pushed along the stem and wherever they go from there.
class ExerciseProgressTest : public testing::Test {
 protected:
  void begin(const Json& json) {
    const Exercise exercise = parsed(json);
    const std::vector<InstrumentModel> models = instruments_named(exercise.instruments);
    instruments_.emplace(tree_, models, find_entry(tree_, exercise.entry, models.front()));
    monitor_.emplace(*instruments_, names_of(models), ExerciseProgress(exercise, tree_));
  }
  void push_to(double insertion_mm, const RunUse& use = {}) {
    for (int k = 0; k < 20'000 && instruments_->pose(0).insertion_mm != insertion_mm; ++k) {
      const double now_mm = instruments_->pose(0).insertion_mm;
      const std::vector<HubPose> poses{{now_mm + std::clamp(insertion_mm - now_mm, -0.1, 0.1), 0}};
      instruments_->step(poses);
      monitor_->add(*instruments_, use);
    }
  }
  const ExerciseState& state() const { return monitor_->progress()->state(); }

  VesselTree tree_ = fork();
  std::optional<Instruments> instruments_;
  std::optional<RunMonitor> monitor_;
};

TEST_F(ExerciseProgressTest, ReachesTargetsInTheirOrder) {
  Json json = usual();
  json["targets"] = Json::parse(R"([{"at_mm": [0, 0, 60], "radius_mm": 6}, {"at_mm": [0, 0, 30]}])");
  begin(json);
  push_to(80);
  EXPECT_EQ(state().reached(), 1);  // the second was passed before the first
  push_to(20);
  EXPECT_TRUE(state().is_passed());
  EXPECT_GT(state().targets[1].reached_s, state().targets[0].reached_s);
  // 100 mm/s: about 54 mm from the introducer to the first.
  EXPECT_NEAR(*state().targets[0].reached_s, 0.54, 0.1);
}

TEST_F(ExerciseProgressTest, CountsForbiddenEntriesOnce) {
  Json json = usual();
  json["forbidden"] = {"left arm", "right arm"};
  json["targets"] =
      Json::parse(R"([{"at_mm": [0, 0, 20], "radius_mm": 8}, {"at_mm": [0, 0, 5], "radius_mm": 2}])");
  begin(json);
  push_to(130);
  ASSERT_EQ(state().forbidden_entries.size(), 1);  // it went into one of both
  push_to(118);
  push_to(130);
  EXPECT_EQ(state().forbidden_entries.size(), 1);
  push_to(60);
  push_to(130);
  EXPECT_EQ(state().forbidden_entries.size(), 2);
  EXPECT_FALSE(state().is_passed());
}

TEST_F(ExerciseProgressTest, TellsWhenALimitIsPassed) {
  Json json = usual();
  json["limits"] = {{"time_s", 0.5}, {"fluoroscopy_s", 10}, {"contrast_ml", 5}, {"force_N", 3}};
  begin(json);
  push_to(80, {.contrast_ml = 6});
  ASSERT_EQ(state().limits.size(), 4);
  EXPECT_NEAR(*state().limits[0].passed_s, 0.501, 1e-9);
  EXPECT_EQ(state().limits[1].value, std::nullopt);  // nobody counts it
  EXPECT_EQ(state().limits[2].value, 6);
  EXPECT_TRUE(state().limits[2].passed_s);
  EXPECT_FALSE(state().limits[3].passed_s);
  EXPECT_GT(state().limits[3].value, 0);
}

TEST_F(ExerciseProgressTest, ReportsWhatIsThereAlone) {
  begin(usual());
  push_to(30, {.fluoroscopy_s = 2.5, .exposures = 7});
  const Json report = Json::parse(monitor_->json(true));
  EXPECT_EQ(report["fluoroscopy_s"], 2.5);
  EXPECT_EQ(report["exposures"], 7);
  for (const char* absent : {"air_kerma_mGy", "dap_Gycm2", "injected_ml", "cine_runs"})
    EXPECT_FALSE(report.contains(absent)) << absent;
  EXPECT_EQ(report["instruments"][0]["name"], "microcatheter-27f");
  EXPECT_EQ(report["exercise"]["targets"][0]["reached_s"], nullptr);
  EXPECT_EQ(report["series"]["time_s"].size(), report["series"]["instruments"][0]["force_N"].size());
  EXPECT_THAT(in_words(*monitor_->progress()), StartsWith("Left arm: not complete; left arm not reached"));
}

}  // namespace
}  // namespace xraycast::exercise_test
