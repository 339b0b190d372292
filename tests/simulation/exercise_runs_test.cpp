// The exercises of examples/exercises in the thorax phantom, by their reference runs.
#include "run_trees.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/simulation/exercise.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

namespace xraycast::exercise_runs_test {
namespace {

/// What is told of a run at its end, and `watch` of each step.
template <typename Watch>
RunMonitor monitored(const RunRequest& request, std::optional<ExerciseProgress> progress,
                     const Watch& watch) {
  std::optional<RunMonitor> monitor;
  Progress reported;
  run(request, reported, [&](const Instruments& moved, double time_s, const InstrumentPressures&) {
    if (!monitor)
      monitor.emplace(moved, names_of(request.instruments), std::move(progress));
    else
      monitor->add(moved);
    watch(*monitor, time_s);
  });
  return std::move(*monitor);
}

class ExerciseFiles : public testing::TestWithParam<const char*> {};

TEST_P(ExerciseFiles, AreSolvedByTheirReferenceRuns) {
  const auto tree = std::make_shared<const VesselTree>(phantom_tree("thorax"));
  const Exercise exercise =
      read_exercise(fmt::format("{}/examples/exercises/{}.json", XRAYCAST_SOURCE_DIR, GetParam()), *tree);
  const RunRequest request{.tree = tree,
                           .instruments = instruments_named(exercise.instruments),
                           .entry = exercise.entry,
                           .script = Script::read(exercise.reference, exercise.instruments.size())};
  const RunMonitor monitor =
      monitored(request, ExerciseProgress(exercise, *tree), [](const auto&, double) {});
  EXPECT_TRUE(monitor.progress()->state().is_passed()) << in_words(*monitor.progress());
  EXPECT_GT(monitor.report().figures().time_s, *monitor.progress()->state().targets.back().reached_s);
}

INSTANTIATE_TEST_SUITE_P(Thorax, ExerciseFiles,
                         testing::Values("1-left-renal", "2-right-renal", "3-left-subclavian",
                                         "4-right-subclavian", "5-right-carotid", "6-left-carotid"));

// The run of docs/simulation.md: over the bifurcation, and rotated once until the tip whips round at 7.6 s.
TEST(RunReportInThorax, CountsAWhip) {
  const RunRequest request{
      .tree = std::make_shared<const VesselTree>(phantom_tree("thorax")),
      .instruments = instruments_named({"cobra-5f"}),
      .entry = {glm::dvec3(-89, -54, -357)},
      .script = Script::parse("time_s,insertion_mm,rotation_deg\n0,0,0\n6,300,0\n8,300,360\n", "whip")};
  int before = -1;
  const RunMonitor monitor = monitored(request, {}, [&](const RunMonitor& so_far, double time_s) {
    if (time_s < 7) before = so_far.report().figures().instruments[0].whips;
  });
  EXPECT_EQ(monitor.report().figures().instruments[0].whips, before + 1);
}

}  // namespace
}  // namespace xraycast::exercise_runs_test
