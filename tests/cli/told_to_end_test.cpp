// What a job's files become when it is told to end before, while or after they get their names; without a
// clock.
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <unistd.h>

namespace xraycast::told_to_end_test {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

/// Each in a process of its own, made of this one before it has a file's name: tests of such suites run
/// first.
class ToldToEndDeathTest : public testing::Test {
 protected:
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder_ / "")) all.push_back(entry.path().filename());
    return all;
  }
  /// In a process that ends with 0 where nothing fails, and with what failed on stderr.
  static void expect_in_a_process(const std::function<void()>& steps) {
    EXPECT_EXIT(
        {
          steps();
          _exit(HasFailure() ? 1 : 0);
        },
        testing::ExitedWithCode(0), "");
  }

  TemporaryFolder folder_;
};

TEST_F(ToldToEndDeathTest, ItsFilesGetNoNames) {
  write_bytes(folder_ / "a", "old");
  expect_in_a_process([&] {
    AtomicFile alone(folder_ / "alone");
    AtomicFolder series(folder_ / "series");
    OutputSet outputs;
    write_whole_file(folder_ / "a", "new");
    write_whole_file(folder_ / "b", "new");
    EXPECT_TRUE(close_outputs());
    EXPECT_THROW(outputs.commit(), Cancelled);
    EXPECT_THROW(series.write("slice", {"new"}), Cancelled);
    EXPECT_THROW(series.commit(), Cancelled);
    EXPECT_THROW(AtomicFile(folder_ / "c"), Cancelled);
    EXPECT_THROW(AtomicFolder(folder_ / "d"), Cancelled);
    EXPECT_EQ(files_written(), 0);
  });
  EXPECT_EQ(read_bytes(folder_ / "a"), "old");
}

TEST_F(ToldToEndDeathTest, AJobThatHasItsFilesGoesOn) {
  expect_in_a_process([&] {
    write_whole_file(folder_ / "a", "new");
    EXPECT_FALSE(close_outputs());
    EXPECT_FALSE(abandon_outputs());
    write_whole_file(folder_ / "a", "newer");
  });
  EXPECT_EQ(read_bytes(folder_ / "a"), "newer");
}

TEST_F(ToldToEndDeathTest, AFolderIsAJobsLastFileToo) {
  expect_in_a_process([&] {
    AtomicFolder series(folder_ / "series");
    series.write("slice", {"new"});
    series.commit();
    EXPECT_FALSE(close_outputs());
  });
}

TEST_F(ToldToEndDeathTest, ASeriesIsNotDoneWithOneOfItsFiles) {
  expect_in_a_process([&] {
    const OutputSeries frames;
    write_whole_file(folder_ / "frame-0", "new");
    EXPECT_TRUE(close_outputs());
    write_whole_file(folder_ / "frame-1", "new");
    EXPECT_TRUE(abandon_outputs());
    EXPECT_THROW(write_whole_file(folder_ / "frame-2", "new"), Cancelled);
    EXPECT_EQ(files_written(), 2);
  });
  EXPECT_THAT(names(), UnorderedElementsAre("frame-0", "frame-1"));
}

TEST_F(ToldToEndDeathTest, AtOnceItRemovesWhatIsUnfinished) {
  expect_in_a_process([&] {
    AtomicFile file(folder_ / "map.exr");
    AtomicFolder series(folder_ / "series");
    series.write("slice", {"new"});
    EXPECT_TRUE(abandon_outputs());
    EXPECT_THAT(names(), IsEmpty());
  });
}

}  // namespace
}  // namespace xraycast::told_to_end_test
