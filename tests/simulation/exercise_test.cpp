#include "xraycast/simulation/exercise.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <filesystem>
#include <optional>
#include <random>

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

/// Text of letters, blanks, umlauts and what is no text, of any length.
std::string odd_name(std::mt19937& random) {
  static constexpr std::array<const char*, 10> kParts{"a",  "Z", " ",  "  ",      "_", "\u00e4\u00f6",
                                                      "\t", "7", "\"", "left arm"};
  std::string name;
  for (auto left = random() % 60; left > 0; --left) name += kParts[random() % kParts.size()];
  return name;
}

TEST(Exercise, IsReadBackWhateverVesselsAreCalled) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937 random(seed);
    const auto chance = [&random](unsigned of) { return random() % of == 0; };
    const VesselTree plain = fork();
    const VesselTree tree = with_branch_names(plain, {odd_name(random), odd_name(random), odd_name(random)});
    Json json = usual(), another = usual();  // with the vessels as targets, and as forbidden ones
    json["targets"] = json["forbidden"] = another["forbidden"] = Json::array();
    another["targets"] = {{{"at_mm", {0, 0, 50}}}};
    for (auto left = 1 + random() % 4; left > 0; --left) {
      const auto branch = static_cast<std::size_t>(random() % 3);
      Json target{{"vessel", branch}, {"depth_mm", 1.0 + static_cast<double>(random() % 40) / 7}};
      // The user writes a name as branches_named takes it.
      if (!tree.branches()[branch].name.empty() && chance(2))
        target["vessel"] = std::string(random() % 90, ' ') + tree.branches()[branch].name;
      if (chance(3))
        target = {{"at_mm", {0.1, 0, 3.0 + static_cast<double>(random() % 90)}}, {"radius_mm", 3}};
      if (chance(2)) target["instrument"] = 1;
      another["forbidden"].push_back(target.contains("vessel") ? target["vessel"] : Json(branch));
      json["targets"].push_back(target);
    }
    for (const Json& written : {json, another}) {
      const std::string once = to_json(parse_exercise(written.dump(), "e.json", tree));
      for (const VesselTree* other : {&tree, &plain})
        EXPECT_EQ(to_json(parse_exercise(once, "again", *other)), once) << seed;
    }
  }
}

TEST(Exercise, MarksTargetsAtTheirDepth) {
  Json json = usual();
  json["targets"][0] = {{"vessel", "left arm"}, {"depth_mm", 20}};
  const TargetMark mark = mark_of(parsed(json).targets[0], fork());
  EXPECT_EQ(mark.branch, 1);
  EXPECT_NEAR(mark.arc_length_mm, 26, 1e-9);  // the stem's radius is 6 mm
  EXPECT_NEAR(mark.at_mm.x, 0.6 * 26, 1e-9);
  EXPECT_NEAR(mark.at_mm.z, 100 + 0.8 * 26, 1e-9);
  EXPECT_EQ(mark.radius_mm, 5);
}

TEST(Exercise, MarksAVesselWhoseFirstBranchHasALargerNumber) {
  std::vector<VesselBranch> branches(2);
  branches[0].points = {{{0, 0, 50}, 5}, {{0, 0, 100}, 5}};
  branches[1].points = {{{0, 0, 0}, 5}, {{0, 0, 50}, 5}};
  branches[0].parent = 1;
  const VesselTree tree(branches, "two");
  const TargetMark mark = mark_of({.name = "", .branches = {0, 1}, .depth_mm = 10}, tree);
  EXPECT_EQ(mark.branch, 1);
  EXPECT_EQ(mark.at_mm.z, 10);
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
            "e.json: \"targets\"[0]: \"instrument\": must be 1: there is one instrument");
  EXPECT_EQ(with("/forbidden/0", "left arm"),
            "e.json: \"forbidden\": left arm is a target, so that nobody could pass; leave one of them out");
  EXPECT_EQ(with("/targets", Json::array()), "e.json: \"targets\": is not a list of 1 to 100");
  EXPECT_EQ(with("/title", ""), "e.json: \"title\": has 0 bytes; give 1 to 80");
  EXPECT_EQ(
      with("/limit", Json::object()),
      "e.json: has no field \"limit\"; the fields are title, task, entry, instruments, devices, targets, "
      "forbidden, limits, reference");
  EXPECT_EQ(with("/targets/0/at_mm", {0, 0, 0}),
            "e.json: \"targets\"[0]: has both of \"vessel\" and \"at_mm\"; give one");
  EXPECT_THAT(message_of(Json::array()), StartsWith("e.json: is not an object"));
  EXPECT_THROW(parse_exercise("{", "e.json", fork()), InputError);
  try {
    parse_exercise("{\"title\": \"a\",\n\"task\": \"b\"\n\"targets\": []}", "e.json", fork());
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), StartsWith("e.json: line 3: no valid JSON"));
  }
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

TEST(Exercise, TakesAPresetBeforeAFileOfItsName) {
  const TemporaryFolder folder;
  Json json = usual();
  write_whole_file(folder / "e.json", json.dump());
  write_whole_file(folder / "microcatheter-27f", "no instrument");
  EXPECT_EQ(read_exercise(folder / "e.json", fork()).instruments[0], "microcatheter-27f");
}

TEST(Exercise, HasAWayToItsTargets) {
  const TemporaryFolder folder;
  const auto read = [&](const char* entry, const char* target, const char* forbidden) {
    Json json = usual();
    json["entry"] = entry;
    json["targets"][0] = {{"vessel", target}};
    json["forbidden"] = {forbidden};
    write_whole_file(folder / "e.json", json.dump());
    return read_exercise(folder / "e.json", fork());
  };
  EXPECT_NO_THROW(read("right arm", "left arm", "stem"));  // past its end
  EXPECT_NO_THROW(read("stem", "left arm", "right arm"));
  try {
    read("stem", "left arm", "stem");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(
        error.what(),
        HasSubstr("\"forbidden\": the way from the entry to left arm leads through stem; leave it out"));
  }
  EXPECT_THROW(read("right arm", "left arm", "right arm"), InputError);
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

TEST_F(ExerciseProgressTest, ReachesAVesselFromItsFarEndWhereItsMarkIs) {
  Json json = usual();
  json["entry"] = "right arm";
  json["forbidden"] = Json::array();
  json["targets"] = {{{"vessel", "stem"}, {"depth_mm", 40}}};
  begin(json);
  push_to(70);  // in the stem, at a depth of some 90 mm
  EXPECT_EQ(instruments_->tip(0).branch, 0);
  EXPECT_EQ(state().reached(), 0);
  push_to(112);
  EXPECT_EQ(state().reached(), 0);
  push_to(130);
  EXPECT_EQ(state().reached(), 1);
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

TEST_F(ExerciseProgressTest, CountsNoEntryAnewAtTheOriginOfAVesselBeyond) {
  Json json = usual();
  json["forbidden"] = {"stem"};
  json["targets"][0] = {{"vessel", "left arm"}, {"depth_mm", 50}};
  begin(json);
  for (const double insertion_mm : {104, 97, 104, 97, 105, 90}) push_to(insertion_mm);
  EXPECT_EQ(state().forbidden_entries.size(), 1);
  push_to(130);
  push_to(80);
  EXPECT_EQ(state().forbidden_entries.size(), 2);  // back from an arm
}

// In the middle of a wide vessel the wall is far, and is not asked for at each step.
TEST(ExerciseInAWideVessel, IsJudgedByWhereTheTipIs) {
  std::vector<VesselBranch> branches(1);
  for (int k = 0; k <= 40; ++k) branches[0].points.push_back({{0, 0, 5.0 * k}, 15});
  const VesselTree tree(branches, "wide");
  Json json = usual();
  json["forbidden"] = Json::array();
  json["targets"] =
      Json::parse(R"([{"at_mm": [0, 0, 80], "radius_mm": 14}, {"vessel": 0, "depth_mm": 120}])");
  const Exercise exercise = parse_exercise(json.dump(), "e.json", tree);
  const std::vector<InstrumentModel> models = instruments_named({"guidewire-035-straight"});
  Instruments instruments(tree, models, find_entry(tree, {0, "entry"}, models.front()));
  RunMonitor monitor(instruments, names_of(models), ExerciseProgress(exercise, tree));
  std::array<std::optional<double>, 2> reached_s;
  for (int k = 1; k <= 1500; ++k) {
    instruments.step(std::vector<HubPose>{{0.1 * k, 0}});
    monitor.add(instruments);
    const InstrumentTip tip = instruments.tip(0);
    ASSERT_EQ(tip.scan_mm, tip.position_mm);
    ASSERT_NEAR(tip.arc_length_mm, tree.nearest(tip.position_mm).arc_length_mm, 0.01);
    const double time_s = monitor.report().figures().time_s;
    if (!reached_s[0] && glm::distance(tip.position_mm, {0, 0, 80}) <= 14) reached_s[0] = time_s;
    if (reached_s[0] && !reached_s[1] && tip.position_mm.z >= 120) reached_s[1] = time_s;
  }
  const ExerciseState& state = monitor.progress()->state();
  for (std::size_t t = 0; t < 2; ++t) {
    ASSERT_TRUE(reached_s[t] && state.targets[t].reached_s);
    EXPECT_NEAR(*state.targets[t].reached_s, *reached_s[t], 1e-3);  // a step, of 0.1 mm
  }
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

// Of steps of the length of the series' interval, so that an hour is soon over.
TEST(RunMonitor, SaysThatTheValuesOverTimeEnd) {
  std::vector<VesselBranch> branches(1);
  branches[0].points = {{{0, 0, 0}, 3}, {{0, 0, 40}, 3}};
  const VesselTree tree(branches, "tube");
  const std::vector<InstrumentModel> models = instruments_named({"microcatheter-27f"});
  Instruments instruments(tree, models, find_entry(tree, {}, models.front()),
                          {.spacing_mm = 5, .step_s = RunReport::kSeries_s});
  RunMonitor monitor(instruments, names_of(models));
  const auto step = [&] {
    instruments.step(std::vector<HubPose>{{2, 0}});
    monitor.add(instruments);
  };
  for (std::size_t k = 0; k < RunReport::kMostSeries; ++k) step();
  EXPECT_FALSE(Json::parse(monitor.json(true)).contains("notes"));
  for (int k = 0; k < 5; ++k) step();
  const Json report = Json::parse(monitor.json(true));
  EXPECT_EQ(report["notes"][0], "the values over time end after 1 h; the figures are of all of the run");
  EXPECT_EQ(report["series"]["time_s"].size(), RunReport::kMostSeries);
  EXPECT_FALSE(Json::parse(monitor.json(false)).contains("notes"));
}

}  // namespace
}  // namespace xraycast::exercise_test
