#include "xraycast/simulation/run.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace xraycast::run_test {
namespace {

/// Closed at its end, 60 mm from the entry.
std::shared_ptr<const VesselTree> short_tube() {
  const std::vector<VesselPoint> points{{{0, 0, 0}, 2}, {{0, 0, 60}, 2}};
  return std::make_shared<const VesselTree>(std::vector<VesselBranch>{{points, -1, {}, {}}}, "tube");
}

/// A microcatheter that moves on by 20 mm in a fifth of a second.
RunRequest push() {
  return {
      .tree = short_tube(),
      .instruments = instruments_named({"microcatheter-27f"}),
      .script = Script::parse("time_s,insertion_mm,rotation_deg\n0,10,0\n0.1,20,0\n0.2,30,0\n", "push.csv")};
}

TEST(Run, RefusesAFirstRowThatAnInstrumentDoesNotReach) {
  const RunRequest request{
      .tree = short_tube(),
      .instruments = instruments_named({"exchange-035-stiff"}),
      .script = Script::parse("time_s,insertion_mm,rotation_deg\n0,400,0\n1,400,0\n", "push.csv")};
  Progress progress;
  EXPECT_THAT([&] { run(request, progress); },
              testing::ThrowsMessage<InputError>(testing::MatchesRegex(
                  "push.csv: line 2: exchange-035-stiff stops at [0-9]+ of 400 mm, where 3 N do not push it "
                  "further; begin with less")));
}

TEST(Run, TellsOfTheFirstPosesAndOfEveryStep) {
  std::vector<double> times_s, insertions_mm;
  Progress progress;
  const auto told =
      run(push(), progress, [&](const Instruments& instruments, double time_s, const InstrumentPressures&) {
        times_s.push_back(time_s);
        insertions_mm.push_back(instruments.pose(0).insertion_mm);
      });
  ASSERT_EQ(times_s.size(), 201u);
  EXPECT_EQ(times_s.front(), 0);
  EXPECT_EQ(insertions_mm.front(), 10) << "the hub has been moved there";
  EXPECT_EQ(insertions_mm.back(), told.records.back()[0].pose.insertion_mm);
  EXPECT_EQ(told.last[0].tip.position_mm, told.records.back()[0].tip.position_mm);
}

TEST(Run, RecordsRowsOrAtAnInterval) {
  Progress progress;
  RunRequest request = push();
  const auto of_rows = run(request, progress);
  ASSERT_EQ(of_rows.records.size(), 3u);
  request.interval_s = 0.05;
  const auto at_interval = run(request, progress);
  ASSERT_EQ(at_interval.records.size(), 5u);
  for (const std::size_t row : {0, 1, 2}) {
    EXPECT_NEAR(at_interval.records[2 * row][0].time_s, of_rows.records[row][0].time_s, 1e-12);
    EXPECT_EQ(at_interval.records[2 * row][0].load.force_N, of_rows.records[row][0].load.force_N);
  }
}

TEST(Run, SaysThatAHubWasHeld) {
  RunRequest request = push();
  Progress progress;
  EXPECT_TRUE(run(request, progress).notes.empty());
  request.instruments = instruments_named({"exchange-035-stiff"});
  request.script = Script::parse("time_s,insertion_mm,rotation_deg\n0,10,0\n1,200,0\n", "push.csv");
  const auto held = run(request, progress);
  EXPECT_GT(held.held_s, 0.1);
  ASSERT_EQ(held.notes.size(), 1u);
  EXPECT_THAT(held.notes[0], testing::HasSubstr("because the push force would have exceeded 3 N"));
}

struct BadRun {
  const char* name;
  std::function<void(RunRequest&)> change;
  const char* message;
};
void PrintTo(const BadRun& bad, std::ostream* out) { *out << bad.name; }

class BadRuns : public testing::TestWithParam<BadRun> {};

TEST_P(BadRuns, AreRefusedBeforeTheyBegin) {
  RunRequest request = push();
  GetParam().change(request);
  EXPECT_THAT([&] { check(request); },
              testing::ThrowsMessage<InputError>(testing::HasSubstr(GetParam().message)));
}

const BadRun kBadRuns[] = {
    {"NoTree", [](RunRequest& r) { r.tree = nullptr; }, "`tree`: missing"},
    {"NoInstrument", [](RunRequest& r) { r.instruments.clear(); }, "0 instruments; give one to 3"},
    {"TooThick",
     [](RunRequest& r) {
       r.instruments = instruments_named({"microcatheter-27f", "cobra-5f"});
     },
     "list the outermost instrument first"},
    {"NoSuchEntry",
     [](RunRequest& r) {
       r.entry = {7, "`entry` 7"};
     },
     "`entry` 7: there is no branch 7"},
    {"TooDeep",
     [](RunRequest& r) {
       std::vector<Script::Row> rows(2);
       rows[1].time_s = 9;
       rows[1].pose.insertion_mm = 1300;
       r.script = Script::of(rows, "`script`");
     },
     "`script`: row 2: insertion_mm 1300; microcatheter-27f can be inserted by at most 1280 mm"},
    {"FinerThanAStep", [](RunRequest& r) { r.interval_s = 1e-4; }, "`interval_s` 0.0001: must be 0"},
    {"InjectsTooFast", [](RunRequest& r) { r.injection = {.to_s = 0.1, .rate_ml_s = 51}; },
     "`injection_rate_ml_s` 51: must be above 0 and at most 50 ml/s"},
    {"InjectsBackInTime", [](RunRequest& r) { r.injection = {.from_s = 0.1, .to_s = 0}; },
     "`inject` 0.1,0: must begin at 0 s or later, and before it ends"},
    {"InjectsAfterTheEnd", [](RunRequest& r) { r.injection = {.from_s = 1, .to_s = 2}; },
     "`inject` 1,2: begins after the end of push.csv at 0.2 s"},
    {"InjectsThroughAWire",
     [](RunRequest& r) {
       r.instruments = instruments_named({"guidewire-014-angled"});
       r.injection = {.to_s = 0.1};
     },
     "`inject` 0,0.1: guidewire-014-angled has no lumen; leave `inject` out"},
};

INSTANTIATE_TEST_SUITE_P(Run, BadRuns, testing::ValuesIn(kBadRuns),
                         [](const auto& bad) { return bad.param.name; });

TEST(Run, LogsNoNegativeZeros) {
  RunRecord record;
  record.pose = {.insertion_mm = -0.0, .rotation_rad = -0.0};
  record.load = {.force_N = -0.0, .torque_Nm = -0.0};
  record.tip.position_mm = {-1e-9, -0.0, -2};
  record.tip.direction = {0, -4e-7, 1};
  record.pressure_mmHg = 80.25;
  record.aortic_mmHg = 93.5;
  const std::string csv = to_csv({.entry = {}, .records = {{record}}, .last = {}});
  EXPECT_EQ(csv.substr(csv.find('\n') + 1),
            "0,0,0,0,0,0.000000,0.000000,-2.000000,0.000000,0.000000,1.000000,0,0.000000,0,0,0,80.25,93.5\n");
}

}  // namespace
}  // namespace xraycast::run_test
