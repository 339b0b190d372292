// Every writer at random moments and on disks of all sizes: some hundred runs of the program.
#include "cli/writers.hpp"
#include "support/leftover.hpp"
#include "support/scan_files.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <sched.h>
#include <set>
#include <sys/mount.h>
#include <thread>

namespace xraycast::cli_runs_test {
namespace {

namespace fs = std::filesystem;

// A suite each, so that they run side by side and each within a test's time.
class KilledWriter : public EveryWriter {};
class WriterOnAFullDisk : public EveryWriter {};
class WriterOnASmallDisk : public EveryWriter {};

TEST_P(KilledWriter, LeavesWholeFilesOrTheOldOnes) {
  constexpr int kRounds = 2;
  std::mt19937 random(1);
  int ended = 0;
  // Where every run was over before its signal, the first one was slow: then earlier and earlier.
  constexpr double kEarliest = 1.0 / 64;
  double share = 1;
  for (int round = 0; round < kRounds || (ended == 0 && share > kEarliest); ++round) {
    if (round >= kRounds) share /= 2;
    for (const int signal : {SIGKILL, SIGTERM, SIGINT, SIGHUP, SIGPIPE})
      ended += expect_survival(signal, share * took_s_, random);
  }
  RecordProperty("ended", ended);
  EXPECT_GT(ended, 0) << "all runs were over before their signals";
}

TEST_P(WriterOnAFullDisk, KeepsTheOldFiles) {
  constexpr int kPlaces = 5;
  std::mt19937 random(2);
  for (int place = 0; place < kPlaces; ++place) {
    const std::uintmax_t disk_B = random() % size_B_;
    expect_failure(on_disk_of(disk_B), fmt::format("after {} of {} bytes", disk_B, size_B_));
  }
}

TEST_P(WriterOnASmallDisk, KeepsTheOldFiles) {
  // A file system of pages: the old files fill it, but for some that hold not all of the new ones. It is
  // mounted where only this process sees it, and gone with it.
  constexpr std::uintmax_t kPage_B = 4096;
  const auto pages = [](std::uintmax_t size_B) { return (size_B + kPage_B - 1) / kPage_B; };
  std::uintmax_t old_pages = 0, new_pages = 0;
  for (const auto& [name, content] : old_) old_pages += pages(content.first);
  for (const auto& [name, size_B] : whole_) new_pages += pages(size_B);
  const fs::path out = folder_ / "out";
  int disks = 0;
  for (const std::uintmax_t free : std::set{std::uintmax_t{0}, new_pages / 2}) {
    if (free > 0 && GetParam().appearing == Appearing::one_by_one) continue;  // the old ones make room
    // A size of 0 would be none.
    const std::string size = fmt::format("size={}", std::max<std::uintmax_t>(1, old_pages + free) * kPage_B);
    if (unshare(CLONE_NEWNS) != 0 || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("tmpfs", out.c_str(), "tmpfs", 0, size.c_str()) != 0)
      GTEST_SKIP() << "mounting needs CAP_SYS_ADMIN: " << std::strerror(errno);
    put_old_files();
    expect_failure(command(GetParam().line), fmt::format("on a disk of {}", size));
    umount(out.c_str());
    ++disks;
  }
  RecordProperty("disks", disks);
}

// ---- the demo, which runs them in turn ---------------------------------------------------------------

class KilledDemo : public CliOutput {
 protected:
  /// By its own format, as most of its files differ from run to run.
  void expect_whole(const fs::path& file) const {
    const std::string extension = file.extension().string();
    Progress unheard;
    if (extension == ".exr")
      EXPECT_NO_THROW(read_body_map(file)) << file;
    else if (extension == ".nrrd")
      EXPECT_NO_THROW(open_scan(file, {}, unheard)) << file;
    else if (extension == ".stl")
      EXPECT_NO_THROW(read_mesh(file)) << file;
    else if (file.filename() == "names.json")
      EXPECT_TRUE(nlohmann::json::accept(read_bytes(file))) << file;
    else if (extension == ".json")
      EXPECT_NO_THROW(read_tree(file)) << file;
    else
      EXPECT_TRUE(read_bytes(file).ends_with(end_of(extension))) << file << " is partial";
  }
  void expect_whole_files(bool may_leave_parts) const {
    if (!fs::exists(folder_ / "out")) return;  // ended before it made the folder
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out"))
      if (entry.is_regular_file() && !(may_leave_parts && is_leftover(entry.path())))
        expect_whole(entry.path());
  }

 private:
  static std::string end_of(const std::string& extension) {
    if (extension == ".png") return "IEND\xAE\x42\x60\x82";
    if (extension == ".gif") return ";";
    if (extension == ".html") return "</html>\n";
    if (extension == ".vtp") return "</VTKFile>\n";
    return "a file of the demo that this test does not know";
  }
};

TEST_F(KilledDemo, LeavesWholeFiles) {
  std::mt19937 random(3);
  // Within the steps that take most of its time: half a minute on two quiet cores.
  std::uniform_real_distribution moment_s(2.0, 25.0);
  Command whole = command("demo -o @/out -q");
  whole.patience = std::chrono::seconds(200);
  int ended = 0;
  bool was_killed = false;  // what a killed run leaves stays until its file is written again
  for (const int signal : {SIGKILL, SIGTERM, SIGKILL}) {
    Process demo(whole);
    std::this_thread::sleep_for(std::chrono::duration<double>(moment_s(random)));
    demo.send(signal);
    const Finished done = demo.finish();
    EXPECT_THAT(done.status, testing::AnyOf(0, 128 + signal)) << done.err;
    ended += done.status != 0;
    was_killed |= signal == SIGKILL;
    expect_whole_files(was_killed);
  }
  EXPECT_GT(ended, 0) << "all runs were over before their signals";
  EXPECT_EQ(run_process(whole).status, 0);
  expect_whole_files(false);
}

constexpr auto name_of = [](const auto& writer) { return std::string(writer.param.name); };
const auto kAll = testing::ValuesIn(writers().begin(), writers().end());
INSTANTIATE_TEST_SUITE_P(, KilledWriter, kAll, name_of);
INSTANTIATE_TEST_SUITE_P(, WriterOnAFullDisk, kAll, name_of);
INSTANTIATE_TEST_SUITE_P(, WriterOnASmallDisk, kAll, name_of);

}  // namespace
}  // namespace xraycast::cli_runs_test
