#include "xraycast/phase_registration/program_run.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

namespace xraycast::program_run_test {
namespace {

using ::testing::ElementsAre;

struct Told {
  std::vector<std::string> lines;
  std::optional<int> status;
};

Told run_shell(const std::string& script, const Progress& progress = {}) {
  Told told;
  told.status = run_program(
      {"sh", "-c", script}, [&](std::string_view line) { told.lines.emplace_back(line); }, progress);
  return told;
}

TEST(RunProgram, TellsWhatItWritesLineByLine) {
  const Told told =
      run_shell("echo one; printf 'two\\r\\n' >&2; sleep 0.2; printf 'th'; sleep 0.2; printf 'ree'");
  EXPECT_THAT(told.lines, ElementsAre("one", testing::StartsWith("two"), "three"));
  EXPECT_EQ(told.status, 0);
}

TEST(RunProgram, TellsHowItEnded) {
  EXPECT_EQ(run_shell("exit 3").status, 3);
  EXPECT_EQ(run_shell("kill -TERM $$").status, 128 + SIGTERM);
  EXPECT_FALSE(run_program(
                   {"xraycast-no-such-program"}, [](std::string_view) {}, Progress())
                   .has_value());
}

TEST(RunProgram, KillsItWhenCancelled) {
  Progress progress;
  const Stopwatch stopwatch;
  std::jthread operator_thread([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    progress.cancel();
  });
  std::string process;
  // One that ignores what asks it to end.
  EXPECT_THROW(run_program(
                   {"sh", "-c", "trap '' TERM INT; echo $$; exec sleep 60"},
                   [&](std::string_view line) { process = line; }, progress),
               Cancelled);
  EXPECT_LT(stopwatch.ms(), 1500);  // 200 and two looks of 100, on a machine that does other things too
  EXPECT_NE(kill(std::stoi(process), 0), 0) << "it goes on";
}

TEST(RunProgram, HasNoInput) { EXPECT_THAT(run_shell("cat; echo end").lines, ElementsAre("end")); }

}  // namespace
}  // namespace xraycast::program_run_test
