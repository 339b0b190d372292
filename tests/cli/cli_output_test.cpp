// What the program leaves behind on a full disk, after signals, and where its output is no file.
#include "cli/writers.hpp"
#include "support/scan_files.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <random>
#include <sstream>
#include <sys/stat.h>
#include <thread>
#include <vector>

namespace xraycast::cli_output_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr char kTree[] =
    R"({"branches": [{"id": 0, "parent": -1, "points": [[0, 0, 0, 2], [0, 0, 100, 2]]}]})";

// ---- every writer, at a few moments; cli_runs_test.cpp takes many ------------------------------------

TEST_P(EveryWriter, KeepsTheOldFilesOnAFullDisk) {
  expect_failure(on_disk_of(0), "from the start");
  for (const unsigned thirds : {1U, 2U})
    expect_failure(on_disk_of(thirds * size_B_ / 3), fmt::format("after {} thirds", thirds));
  // Not by a byte: how long a DICOM file's UIDs are differs from run to run.
  expect_failure(on_disk_of(size_B_ - 1 - size_B_ / 100), "just before the end");
  expect_failure(on_late_disk(), "when it is synced");
}

TEST_P(EveryWriter, IsWholeOrNotThereAfterASignal) {
  std::mt19937 random(static_cast<unsigned>(std::string(GetParam().name).size()));
  for (const int signal : {std::array{SIGTERM, SIGINT, SIGHUP, SIGPIPE}[random() % 4], SIGKILL})
    expect_survival(signal, took_s_, random);
}

INSTANTIATE_TEST_SUITE_P(, EveryWriter, testing::ValuesIn(writers().begin(), writers().end()),
                         [](const auto& writer) { return writer.param.name; });

// ---- signals ----------------------------------------------------------------------------------------

TEST_F(CliOutput, ASecondSignalEndsAtOnceAndLeavesNothing) {
  Command on_terminal = command("phantom thorax --size 512x512x2000 -o @/ct.nrrd");
  on_terminal.on_terminal = true;
  Process process(on_terminal);
  process.wait_for("painting");
  process.send(SIGTERM);
  process.send(SIGTERM);
  EXPECT_EQ(process.finish().status, 128 + SIGTERM);
  EXPECT_THAT(content_of(folder_ / ""), IsEmpty());
}

TEST_F(CliOutput, AnInterruptedCineSaysHowManyFramesItWrote) {
  make_inputs();
  Process process(command("render @/map.exr -o @/out --cine 0:360:0.1 --size 64x64"));
  while (!fs::exists(folder_ / "out/frame-005.png"))
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  process.send(SIGINT);
  const Finished done = process.finish();
  EXPECT_EQ(done.status, 128 + SIGINT);
  const Content frames = content_of(folder_ / "out");
  EXPECT_EQ(done.err, fmt::format("xraycast: cancelled after {} files had been written\n", frames.size()));
  for (const auto& [name, content] : frames)
    EXPECT_THAT(read_bytes(folder_ / "out" / name), EndsWith("IEND\xAE\x42\x60\x82")) << name;
}

TEST_F(CliOutput, ALongRunOfACatheterIsInterrupted) {
  write_bytes(folder_ / "tree.json", kTree);
  write_bytes(folder_ / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n80000,1,0\n");
  Process process(
      command("simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv"));
  while (content_of(folder_ / "").size() < 2) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  process.send(SIGTERM);
  EXPECT_EQ(process.finish().status, 128 + SIGTERM);
  EXPECT_FALSE(fs::exists(folder_ / "log.csv"));
}

// ---- standard output --------------------------------------------------------------------------------

TEST_F(CliOutput, AFullStandardOutputIsAFailure) {
  make_inputs();
  for (const char* line : {"PROGRAM info @/ct.nrrd > /dev/full", "PROGRAM --help > /dev/full",
                           "PROGRAM info @/ct.nrrd --json > /dev/full"}) {
    const Finished done = run_in_shell(line);
    EXPECT_EQ(done.status, 1) << line;
    EXPECT_THAT(done.err, EndsWith("xraycast: standard output could not be written; the disk may be full\n"));
  }
  // A reader that has seen enough is no failure worth a word.
  const Finished piped = run_in_shell("PROGRAM --help | true");
  EXPECT_EQ(piped.err, "");
  EXPECT_THAT(piped.status, AnyOf(0, 128 + SIGPIPE));
}

TEST_F(CliOutput, ALogGoesToStandardOutput) {
  write_bytes(folder_ / "tree.json", kTree);
  write_bytes(folder_ / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n0.1,1,0\n");
  const std::string line = "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -q -o ";
  const Finished piped = run(line + "/dev/stdout");
  EXPECT_EQ(piped.status, 0) << piped.err;
  EXPECT_THAT(piped.out, StartsWith("time_s,insertion_mm"));
  EXPECT_EQ(run_in_shell("echo before > @/log.csv; PROGRAM " + line + "/dev/stdout >> @/log.csv").status, 0);
  EXPECT_EQ(read_bytes(folder_ / "log.csv"), "before\n" + piped.out);
  EXPECT_TRUE(fs::is_symlink("/dev/stdout"));
}

TEST_F(CliOutput, WhatAScanSaysDoesNotReachTheTerminalAsCommands) {
  DicomFile slice(8, 8, std::vector<std::int16_t>(64));
  fs::create_directory(folder_ / "scan");
  for (int z = 0; z < 4; ++z)
    slice.position({0, 0, z})
        .text(0x0008103E, "LO",
              "Sch\xE4"
              "del \x1B[2Jclear")
        .write(folder_ / fmt::format("scan/{}.dcm", z));
  const Finished json = run("info @/scan --json");
  EXPECT_EQ(json.status, 0) << json.err;
  EXPECT_TRUE(nlohmann::json::accept(json.out)) << json.out;
  const Finished text = run("info @/scan");
  EXPECT_EQ(text.status, 0) << text.err;
  EXPECT_THAT(text.out, Not(HasSubstr("\x1B")));
  EXPECT_THAT(text.out, HasSubstr("del \\x1b[2Jclear"));
  const Finished missing = run_process({{XRAYCAST_PROGRAM, "info", "/missing\x1B[31m\nscan\x9B"}});
  EXPECT_EQ(missing.status, 3);
  expect_one_line(missing.err, "/missing\\x1b[31m scan\\x9b");
}

// ---- the cache of kernels ---------------------------------------------------------------------------

TEST_F(CliOutput, AFolderOfItsOwnServesWhereNoHomeDoes) {
  write_bytes(folder_ / "a file", "");
  fs::create_directory(folder_ / "tmp");
  fs::create_directory(folder_ / "shared");
  chmod((folder_ / "shared").c_str(), 0777);
  const bool had_shared_cache = fs::exists("/tmp/pocl");
  Command devices = command("devices");
  devices.environment = {{"XDG_CACHE_HOME", ""}, {"TMPDIR", (folder_ / "tmp").string()}};
  for (const std::string& home :
       {std::string(), (folder_ / "a file").string(), (folder_ / "shared").string()}) {
    devices.environment["HOME"] = home;
    const Finished done = run_process(devices);
    EXPECT_EQ(done.status, 0) << home << ": " << done.err;
    EXPECT_THAT(content_of(folder_ / "tmp"), IsEmpty()) << home;
    EXPECT_THAT(content_of(folder_ / "shared"), IsEmpty()) << home;
  }
  EXPECT_EQ(fs::exists("/tmp/pocl"), had_shared_cache);
  devices.environment["POCL_CACHE_DIR"] = (folder_ / "a file/cache").string();
  const Finished refused = run_process(devices);
  EXPECT_EQ(refused.status, 4);
  expect_one_line(refused.err, "POCL_CACHE_DIR");
}

TEST_F(CliOutput, TheNextRunWithoutAHomeRemovesWhatAKilledOneLeft) {
  fs::create_directory(folder_ / "tmp");
  const auto homeless = [&](const std::string& line) {
    Command command = this->command(line);
    command.environment = {{"HOME", ""}, {"XDG_CACHE_HOME", ""}, {"TMPDIR", (folder_ / "tmp").string()}};
    command.on_terminal = true;
    return command;
  };
  const auto folders = [&] {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / "tmp"))
      names.push_back(entry.path().filename());
    return names;
  };
  const std::string long_run = "phantom thorax --size 512x512x2000 -o @/ct.nrrd";
  Process killed(homeless(long_run));
  killed.wait_for("painting");
  killed.send(SIGKILL);
  EXPECT_EQ(killed.finish().status, 128 + SIGKILL);
  const std::vector<std::string> left = folders();
  ASSERT_THAT(left, testing::ElementsAre(StartsWith("xraycast-kernels-")));

  Process alive(homeless(long_run));
  alive.wait_for("painting");
  const std::vector<std::string> used = folders();
  EXPECT_THAT(used, testing::ElementsAre(StartsWith("xraycast-kernels-")));
  EXPECT_NE(used, left);
  EXPECT_EQ(run_process(homeless("devices")).status, 0);
  EXPECT_EQ(folders(), used) << "a running one's folder is gone";
  alive.send(SIGTERM);
  EXPECT_EQ(alive.finish().status, 128 + SIGTERM);
  EXPECT_THAT(folders(), IsEmpty());
}

}  // namespace
}  // namespace xraycast::cli_output_test
