#include "xraycast/reports/run_comparison.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/reports/plot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>

namespace xraycast::run_comparison_test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string report(double time_s, const std::string& more = "") {
  return R"({"version": 1, "time_s": )" + std::to_string(time_s) +
         R"(, "instruments": [{"name": "cobra-5f", "tip_path_mm": 400, "slips": 2}])" + more + "}";
}

const char* const kExercise =
    R"(, "exercise": {"title": "Left <renal>", "is_complete": true, "is_passed": false,
  "targets": [{"name": "left renal artery", "reached_s": 7.84}], "forbidden_entries": [{"name": "aorta", "time_s": 3}],
  "limits": [{"name": "time_s", "limit": 60, "largest": 12.5, "passed_s": null},
             {"name": "fluoroscopy_s", "limit": 9, "largest": null, "passed_s": null},
             {"name": "force_N", "limit": 1, "largest": 1.2, "passed_s": 2}]})";

const char* const kSeries =
    R"(, "series": {"time_s": [0, 0.2, 0.4], "instruments": [{"insertion_mm": [0, 1, 2],
  "tip_path_mm": [0, 1, 2], "force_N": [0, 0.1, 0.2], "torque_mNm": [0, 0, 0], "wall_force_N": [0, 0, 1]}]})";

std::filesystem::path file(const std::string& name) {
  return std::filesystem::path(testing::TempDir()) / ("run-comparison-" + name);
}

TEST(SavedRun, HasWhatWasReported) {
  const SavedRun run = SavedRun::parse(report(12.5, std::string(kExercise) + kSeries), "mine");
  EXPECT_EQ(run.name, "mine");
  EXPECT_EQ(run.figures, (std::map<std::string, double>{{"time_s", 12.5}}));  // and no other
  EXPECT_EQ(run.of_instruments[0].at("slips"), 2);
  EXPECT_TRUE(run.is_complete);
  EXPECT_FALSE(run.is_passed);
  using Outcome = SavedRun::Outcome;
  EXPECT_THAT(
      run.outcomes,
      testing::ElementsAre(Outcome{"target: left renal artery", "7.8 s", 7.84},
                           Outcome{"forbidden: aorta", "3.0 s", 3}, Outcome{"limit: time of 60 s", "12.5 s"},
                           Outcome{"limit: fluoroscopy of 9 s", "not counted"},
                           Outcome{"limit: force at the hub of 1 N", "1.2 N, passed after 2.0 s", 2}));
  EXPECT_EQ(run.complete_s, 7.84);
  EXPECT_EQ(run.curves[0].at("force_N").size(), 3);
}

const char* const kTreatments =
    R"(, "treatments": [{"device": "balloon-6x20", "vessel": "left renal artery", "from_s": 4, "to_s": null,
  "least_before_mm": 2.5, "least_after_mm": 5.9, "residual_stenosis_percent": 1.5, "branch": 17}])";

TEST(SavedRun, HasWhatWasDoneToVessels) {
  const SavedRun run = SavedRun::parse(report(12.5, kTreatments), "mine");
  EXPECT_THAT(run.treatments, testing::ElementsAre("balloon-6x20 in left renal artery"));
  ASSERT_EQ(run.of_treatments.size(), 1u);
  EXPECT_EQ(run.of_treatments[0].at("least_after_mm"), 5.9);
  EXPECT_FALSE(run.of_treatments[0].contains("to_s")) << "it goes on";
  write_runs(file("treated.csv"), {run, SavedRun::parse(report(1), "without")});
  const std::string csv = read_whole_file(file("treated.csv"));
  EXPECT_THAT(csv, HasSubstr("treatment_1,treatment_1_from_s,treatment_1_to_s,"));
  EXPECT_THAT(csv, HasSubstr(",\"balloon-6x20 in left renal artery\",4,,"));
  EXPECT_EQ(
      std::count(csv.begin(), csv.begin() + static_cast<std::ptrdiff_t>(csv.find('\n')), ','),
      std::count(csv.begin() + static_cast<std::ptrdiff_t>(csv.rfind('\n', csv.size() - 2)), csv.end(), ','))
      << "as many columns in the row of the run without";
  write_runs(file("treated.html"), {run});
  const std::string page = read_whole_file(file("treated.html"));
  EXPECT_THAT(page, HasSubstr("residual stenosis"));
  EXPECT_THAT(page, HasSubstr("<td>5.90 mm</td>"));
  EXPECT_THROW(SavedRun::parse(report(1, R"(, "treatments": [3])"), "bad"), InputError);
}

TEST(SavedRun, RefusesWhatIsNone) {
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string("{}"), report(1, R"(, "series": {"time_s": 3})"),
        std::string(R"({"version": 1, "time_s": "x", "instruments": []})"),
        std::string(R"({"version": 1, "instruments": [3]})"),
        report(1, R"(, "series": {"time_s": [1], "instruments": [{}]})"), report(1, R"(, "exercise": [])"),
        report(1, R"(, "exercise": {"targets": [3]})")})
    EXPECT_THROW(SavedRun::parse(text, "bad"), InputError) << text;
}

TEST(Runs, AreReadAsTheyWereWritten) {
  const std::vector<SavedRun> runs{SavedRun::parse(report(1), "a"), SavedRun::parse(report(2, kSeries), "b")};
  write_runs(file("all.json"), runs, SavedRun::parse(report(0.5), "best"));
  const SavedRuns again = read_runs(file("all.json"));
  ASSERT_EQ(again.runs.size(), 2);
  EXPECT_EQ(again.runs[1].json, runs[1].json);
  ASSERT_TRUE(again.reference);
  EXPECT_EQ(again.reference->name, "best");
  write_runs(file("one.json"), {runs[0]});
  EXPECT_EQ(read_runs(file("one.json")).runs[0].name, "run-comparison-one");
  EXPECT_FALSE(read_runs(file("one.json")).reference);
}

TEST(Runs, AreOfOneVersion) {
  write_whole_file(file("two.json"), R"({"version": 2, "runs": [)" + report(1) + "]}");
  EXPECT_THROW(read_runs(file("two.json")), InputError);
  write_whole_file(file("none.json"), R"({"runs": [)" + report(1) + "]}");
  EXPECT_THROW(read_runs(file("none.json")), InputError);
}

/// An exercise with so many of a list.
std::string many(const std::string& list, int count, const std::string& time) {
  std::string text = R"(, "exercise": {"title": "t", ")" + list + "\": [";
  for (int k = 0; k < count; ++k)
    text += (k > 0 ? "," : "") + (R"({"name": "n)" + std::to_string(k) + "\", \"" + time + "\": 1}");
  return text + "]}";
}

TEST(SavedRun, HasAsManyTargetsAsAnExercise) {
  EXPECT_EQ(SavedRun::parse(report(1, many("targets", 100, "reached_s")), "a").outcomes.size(), 100);
  for (const char* list : {"targets", "limits", "forbidden_entries"})
    EXPECT_THROW(SavedRun::parse(report(1, many(list, 101, "time_s")), "a"), InputError) << list;
}

TEST(SavedRun, KeepsItsNotes) {
  const SavedRun run = SavedRun::parse(report(1, R"(, "notes": ["ends <early>"])"), "a");
  write_runs(file("notes.html"), {run});
  EXPECT_THAT(read_whole_file(file("notes.html")), HasSubstr("ends &lt;early&gt;"));
  EXPECT_THROW(SavedRun::parse(report(1, R"(, "notes": [3])"), "a"), InputError);
}

// As many as there are in a plot over time, one above the other: no two are alike in colour or in dashes.
TEST(Plot, TellsEightCurvesApart) {
  std::vector<Curve> curves;
  for (std::size_t c = 0; c < 8; ++c) {
    curves.push_back({"", {}, {}, c});
    for (int k = 0; k <= 100; ++k) curves.back().points.emplace_back(k, 10.0 * static_cast<double>(c));
  }
  const RgbPicture picture = plot("t", "x", "y", curves);
  std::set<std::array<int, 3>> colours;
  std::set<std::vector<bool>> patterns;
  for (std::size_t c = 0; c < 8; ++c) {
    const std::vector<Curve> alone{{"", {{0, 0}, {100, 80}}, Colour{1, 1, 1}},
                                   {"", {{0, 40}, {100, 40}}, {}, c}};
    const RgbPicture one = plot("t", "x", "y", alone);
    // The row of the line, in the middle of the plot; strokes have less blue than paper and grid.
    std::vector<bool> strokes;
    for (int x = 90; x < 860; ++x) {
      int darkest = 255;
      for (int y = 270; y < 278; ++y) darkest = std::min<int>(darkest, one.rgb[3 * (900 * y + x) + 2]);
      strokes.push_back(darkest < 150);
    }
    patterns.insert(strokes);
  }
  for (std::size_t i = 0; i + 2 < picture.rgb.size(); i += 3) {
    const std::array<int, 3> pixel{picture.rgb[i], picture.rgb[i + 1], picture.rgb[i + 2]};
    if (std::ranges::max(pixel) - std::ranges::min(pixel) > 60) colours.insert(pixel);
  }
  EXPECT_EQ(patterns.size(), 8);
  EXPECT_GE(colours.size(), 7);  // and a grey
}

TEST(Runs, AreATableWithALineEach) {
  write_runs(file("runs.csv"),
             {SavedRun::parse(report(1, kExercise), "a \"b\""), SavedRun::parse(report(2), "c")});
  const std::string csv = read_whole_file(file("runs.csv"));
  EXPECT_THAT(csv, HasSubstr(",\"target: left renal artery (s)\",\"forbidden: aorta (s)\","));
  EXPECT_THAT(csv, HasSubstr(",7.84,3,,,2\n"));
  EXPECT_THAT(csv, HasSubstr("\n\"a \"\"b\"\"\",\"Left <renal>\",1,0,1,,"));
  EXPECT_THAT(csv, HasSubstr("\n\"c\",\"\",,,2,,"));
  const auto commas = [](const std::string& line) { return std::ranges::count(line, ','); };
  const std::size_t first = csv.find('\n'), second = csv.find('\n', first + 1);
  EXPECT_EQ(commas(csv.substr(0, first)), commas(csv.substr(first, second - first)));
}

TEST(Runs, AreAPageThatLoadsNothing) {
  write_runs(
      file("runs.html"),
      {SavedRun::parse(report(1, std::string(kExercise) + kSeries), "<a>"), SavedRun::parse(report(2), "c")},
      SavedRun::parse(report(0.5), "best"));
  const std::string html = read_whole_file(file("runs.html"));
  EXPECT_THAT(html, HasSubstr("<th>best</th><th>1. &lt;a&gt;</th><th>2. c</th>"));
  EXPECT_THAT(html, HasSubstr("complete, but not passed, after 7.8 s"));
  EXPECT_THAT(html, HasSubstr("time over the runs"));
  EXPECT_THAT(html, HasSubstr("force at the hub"));
  EXPECT_THAT(html, Not(HasSubstr("://")));
  EXPECT_THAT(html, Not(HasSubstr("scope=\"row\">fluoroscopy")));  // none has one
}

TEST(Runs, AreOfKnownKinds) {
  EXPECT_THROW(check_report_name("runs.txt", "--report runs.txt"), InputError);
  EXPECT_NO_THROW(check_report_name("RUNS.HTML", "x"));
}

}  // namespace
}  // namespace xraycast::run_comparison_test
