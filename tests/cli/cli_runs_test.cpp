// Every writer at random moments and on disks of all sizes: some hundred runs of the program.
#include "cli/writers.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <sched.h>
#include <set>
#include <sys/mount.h>

namespace xraycast {
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
  for (int round = 0; round < kRounds; ++round)
    for (const int signal : {SIGKILL, SIGTERM, SIGINT, SIGHUP, SIGPIPE})
      ended += expect_survival(signal, random);
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

constexpr auto name_of = [](const auto& writer) { return std::string(writer.param.name); };
const auto kAll = testing::ValuesIn(writers().begin(), writers().end());
INSTANTIATE_TEST_SUITE_P(, KilledWriter, kAll, name_of);
INSTANTIATE_TEST_SUITE_P(, WriterOnAFullDisk, kAll, name_of);
INSTANTIATE_TEST_SUITE_P(, WriterOnASmallDisk, kAll, name_of);

}  // namespace
}  // namespace xraycast
