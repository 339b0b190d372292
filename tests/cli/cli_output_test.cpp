// What the program leaves behind on a full disk, after signals, and where its output is no file.
#include "support/process.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/scan/scan.hpp"

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

namespace xraycast {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

/// A folder's files: how long they are, and a hash of what they hold.
using Content = std::map<std::string, std::pair<std::uintmax_t, std::size_t>>;

Content content_of(const fs::path& folder) {
  Content all;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) {
      const std::string bytes = read_bytes(entry.path());
      all[fs::relative(entry.path(), folder)] = {bytes.size(), std::hash<std::string>()(bytes)};
    }
  return all;
}

/// EXR and TIFF files hold the second in which they were written.
std::map<std::string, std::uintmax_t> sizes_of(const Content& content) {
  std::map<std::string, std::uintmax_t> sizes;
  for (const auto& [name, size_and_hash] : content) sizes[name] = size_and_hash.first;
  return sizes;
}

constexpr char kTree[] =
    R"({"branches": [{"id": 0, "parent": -1, "points": [[0, 0, 0, 2], [0, 0, 100, 2]]}]})";

class CliOutput : public testing::Test {
 protected:
  /// `line` is what follows the program's name; @ stands for the test's folder.
  Command command(const std::string& line) const {
    Command result{{XRAYCAST_PROGRAM}};
    std::istringstream words(line);
    for (std::string word; words >> word;) result.words.push_back(replaced(word));
    return result;
  }
  std::string replaced(std::string text) const {
    for (std::size_t at; (at = text.find('@')) != std::string::npos;)
      text.replace(at, 1, (folder_ / "").parent_path().string());
    return text;
  }
  Finished run(const std::string& line) const { return run_process(command(line)); }

  /// In a shell, where PROGRAM stands for the program.
  Finished run_in_shell(std::string line) const {
    for (std::size_t at; (at = line.find("PROGRAM")) != std::string::npos;)
      line.replace(at, 7, XRAYCAST_PROGRAM);
    return run_process({{"/bin/bash", "-o", "pipefail", "-c", replaced(line)}});
  }

  static void expect_one_line(const std::string& err, const std::string& part) {
    EXPECT_THAT(err, StartsWith("xraycast: "));
    EXPECT_THAT(err, HasSubstr(part));
    EXPECT_EQ(std::ranges::count(err, '\n'), 1) << err;
  }

  /// Scans, a map, a basis and a tree, small enough for hundreds of runs.
  void make_inputs() const {
    Volume scan({{24, 24, 40}, {2, 2, 2}, {0, 0, 0}});
    std::mt19937 random(1);
    for (std::int16_t& hu : scan.hu())
      hu = static_cast<std::int16_t>(static_cast<int>(random() % 1000) - 900);  // does not compress
    Progress unheard;
    write_volume(scan, folder_ / "ct.nrrd", unheard);
    const VolumeGeometry& grid = scan.geometry();
    std::vector<std::uint8_t> mask(scan.hu().size());
    for (std::int64_t z = 4; z < 36; ++z)
      for (const std::int64_t y : {12, 13})
        for (const std::int64_t x : {12, 13}) mask[static_cast<std::size_t>(x + 24 * (y + 24 * z))] = 1;
    write_mask(grid, mask, folder_ / "mask.nrrd");

    const MapGeometry geometry = cylinder_map(grid, 60, {0, 10, 20}, {23, 23});
    BodyMap map;
    map.geometry = geometry;
    map.tau.assign(static_cast<std::size_t>(map.layer_size()) * 2, 0.5f);
    write_body_map(map, folder_ / "map.exr");
    Basis basis;
    basis.geometry = geometry;
    basis.knots_hu = {-1024, 32767};
    basis.hu_histogram.assign(256, 0);
    basis.touched.assign(static_cast<std::size_t>(tile_count(geometry)), 1);
    for (std::size_t i = 0; i < basis.touched.size() * 16; ++i)
      basis.weights.push_back(static_cast<std::uint16_t>(random()));
    write_basis(basis, folder_ / "ct.basis");

    write_bytes(folder_ / "tree.json", kTree);
    std::string script = "time_s,insertion_mm,rotation_deg\n";
    for (int i = 0; i < 300; ++i) script += fmt::format("{},{},0\n", 0.001 * i, 0.01 * i);
    write_bytes(folder_ / "push.csv", script);
    fs::create_directory(folder_ / "out");
  }

  TemporaryFolder folder_;
};

// ---- what every writing subcommand writes -----------------------------------------------------------

struct Writer {
  const char* name;
  const char* line;  ///< everything that it writes goes into @/out
};

const Writer kWriters[] = {
    {"Phantom", "phantom sphere --size 24x24x24 --noise 20 -o @/out/ct.mhd"},
    {"Cast",
     "cast @/ct.nrrd --layers 2 --angles 60 -o @/out/map.exr --preview @/out/map.png --keep-basis @/out/b"},
    {"Recast", "recast @/ct.basis --opacity paper -o @/out/map.exr"},
    {"ProjectExr", "project @/ct.nrrd --size 48x48 -o @/out/p.exr"},
    {"ProjectTiff", "project @/ct.nrrd --size 48x48 -o @/out/p.tif"},
    {"ProjectPng", "project @/ct.nrrd --size 48x48 -o @/out/p.png"},
    {"Segment", "segment @/ct.nrrd -o @/out --from-mask @/mask.nrrd --surface tubes"},
    {"Render", "render @/map.exr --size 48x48 -o @/out/f.png"},
    {"Simulate",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/out/log.csv"},
};

class EveryWriter : public CliOutput, public testing::WithParamInterface<Writer> {
 protected:
  void SetUp() override {
    make_inputs();
    const auto start = Clock::now();
    const Finished done = run(GetParam().line);
    took_s_ = std::chrono::duration<double>(Clock::now() - start).count();
    ASSERT_EQ(done.status, 0) << done.err;
    whole_ = sizes_of(found());
    put_old_files();
    old_ = found();
  }
  Content found() const { return content_of(folder_ / "out"); }
  void put_old_files() const {
    for (const auto& [name, size] : whole_) write_bytes(folder_ / "out" / name, "an older " + name);
  }

  void expect_failure(const Command& on_full_disk, const std::string& when) const {
    const Finished done = run_process(on_full_disk);
    EXPECT_EQ(done.status, 1) << when;
    EXPECT_EQ(done.out, "") << when;
    expect_one_line(done.err, "could not be written completely");
    EXPECT_THAT(done.err, HasSubstr((folder_ / "out").string())) << when;
    EXPECT_THAT(done.err, HasSubstr("the disk may be full")) << when;
    EXPECT_EQ(found(), old_) << when;
  }

  /// The status that it ends with when the signal comes at a random moment of its run.
  Finished run_until(int signal, std::mt19937& random) const {
    Process process(command(GetParam().line));
    std::uniform_real_distribution moment_s(0.0, took_s_);
    std::this_thread::sleep_for(std::chrono::duration<double>(moment_s(random)));
    process.send(signal);
    return process.finish();
  }

  using Clock = std::chrono::steady_clock;
  double took_s_ = 0;
  std::map<std::string, std::uintmax_t> whole_;
  Content old_;
};

TEST_P(EveryWriter, KeepsTheOldFilesOnAFullDisk) {
  Command command = this->command(GetParam().line);
  command.environment = {{"LD_PRELOAD", FULL_DISK_LIBRARY}, {"FULL_DISK", (folder_ / "out").string()}};
  // Five places, the last of them a byte before the end.
  std::uintmax_t size = 0;
  for (const auto& [name, size_B] : whole_) size += size_B;
  for (int place = 0; place < 5; ++place) {
    command.environment["FULL_DISK_B"] = std::to_string((size - 1) * place / 4);
    expect_failure(command, fmt::format("after {} of {} bytes", command.environment["FULL_DISK_B"], size));
  }
  command.environment["FULL_DISK_LATE"] = "1";
  expect_failure(command, "when it is synced");
}

TEST_P(EveryWriter, IsWholeOrNotThereAfterASignal) {
  std::mt19937 random(static_cast<unsigned>(std::string(GetParam().name).size()));
  for (const int signal : {std::array{SIGTERM, SIGINT, SIGHUP, SIGPIPE}[random() % 4], SIGTERM}) {
    put_old_files();
    const Finished done = run_until(signal, random);
    EXPECT_THAT(done.status, AnyOf(0, 128 + signal)) << done.err;
    const Content files = found();
    EXPECT_TRUE(done.status == 0 ? sizes_of(files) == whole_ : files == old_) << "after signal " << signal;
    if (!done.err.empty()) expect_one_line(done.err, "cancelled; no output was written");
  }

  put_old_files();
  run_until(SIGKILL, random);
  for (const auto& [name, content] : found())
    EXPECT_TRUE(name.find(".part") != std::string::npos || content == old_[name] ||
                content.first == whole_[name])
        << name;
  EXPECT_EQ(run(GetParam().line).status, 0);
  EXPECT_EQ(sizes_of(found()), whole_) << "what a killed run left stays behind";
}

INSTANTIATE_TEST_SUITE_P(, EveryWriter, testing::ValuesIn(kWriters),
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

}  // namespace
}  // namespace xraycast
