#include "xraycast/base/atomic_file.hpp"

#include "support/file_size_limit.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fcntl.h>
#include <future>
#include <optional>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace xraycast::atomic_file_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;
using ::testing::UnorderedElementsAre;

class AtomicFiles : public testing::Test {
 protected:
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder_ / "")) all.push_back(entry.path().filename());
    return all;
  }
  mode_t mode_of(const std::string& name) const {
    struct stat status {};
    stat((folder_ / name).c_str(), &status);
    return status.st_mode & 0777;
  }
  /// A process that ends while it writes `file`.
  static void die_writing(const fs::path& file) {
    const pid_t id = fork();
    if (id == 0) {
      AtomicFile unfinished(file);
      unfinished.write("half");
      _exit(0);
    }
    waitpid(id, nullptr, 0);
  }

  TemporaryFolder folder_;
};

TEST_F(AtomicFiles, AppearOnlyWhenTheyAreWhole) {
  write_bytes(folder_ / "log.csv", "old");
  {
    AtomicFile file(folder_ / "log.csv");
    file.write("new, ");
    file.write("whole");
    EXPECT_EQ(read_bytes(folder_ / "log.csv"), "old");
    file.commit();
  }
  EXPECT_EQ(read_bytes(folder_ / "log.csv"), "new, whole");
  {
    AtomicFile given_up(folder_ / "log.csv");
    given_up.write("half");
  }
  EXPECT_EQ(read_bytes(folder_ / "log.csv"), "new, whole");
  EXPECT_THAT(names(), ElementsAre("log.csv"));
}

TEST_F(AtomicFiles, HaveTemporaryNamesThatNobodyForesees) {
  const AtomicFile one(folder_ / "scan.nii.gz"), other(folder_ / "scan.nii.gz");
  EXPECT_NE(one.temporary(), other.temporary());
  EXPECT_THAT(one.temporary().filename(),
              testing::ResultOf([](const fs::path& p) { return p.string(); },
                                testing::MatchesRegex("\\.scan\\.[0-9a-f]+\\.part\\.nii\\.gz")));
}

TEST_F(AtomicFiles, TakeNamesAsLongAsTheyMayBe) {
  for (const std::string& name :
       {std::string(251, 'a') + ".csv", "a." + std::string(249, 'b') + ".csv", std::string(255, 'c'),
        std::string("-o.csv"), std::string("two\nlines, größer.csv"), std::string(".hidden")}) {
    write_whole_file(folder_ / name, "content");
    EXPECT_EQ(read_bytes(folder_ / name), "content") << name;
    fs::remove(folder_ / name);
  }
  EXPECT_THAT(names(), IsEmpty());
}

TEST_F(AtomicFiles, KeepThePermissionsOfWhatTheyReplace) {
  const mode_t before = umask(022);
  write_whole_file(folder_ / "new.csv", "");
  EXPECT_EQ(mode_of("new.csv"), 0644u);
  for (const mode_t mode : {0600u, 0664u, 0444u}) {
    chmod((folder_ / "new.csv").c_str(), mode);
    AtomicFile file(folder_ / "new.csv");
    struct stat status {};
    stat(file.temporary().c_str(), &status);
    EXPECT_EQ(status.st_mode & 0077, 0u) << "open to others while it is written";
    file.commit();
    EXPECT_EQ(mode_of("new.csv"), mode);
  }
  umask(before);
}

// ---- what is no plain file --------------------------------------------------------------------------

TEST_F(AtomicFiles, ReplaceWhatALinkPointsTo) {
  fs::create_directory(folder_ / "elsewhere");
  write_bytes(folder_ / "elsewhere/real.csv", "old");
  fs::create_symlink("elsewhere/real.csv", folder_ / "link.csv");
  fs::create_symlink("link.csv", folder_ / "link to it.csv");
  write_whole_file(folder_ / "link to it.csv", "new");
  EXPECT_EQ(read_bytes(folder_ / "elsewhere/real.csv"), "new");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link.csv"));
  EXPECT_TRUE(fs::is_symlink(folder_ / "link to it.csv"));
}

TEST_F(AtomicFiles, RefuseLinksThatLeadNowhereOrToADevice) {
  fs::create_symlink("missing.csv", folder_ / "dangling.csv");
  fs::create_symlink("round.csv", folder_ / "round.csv");
  fs::create_symlink("/dev/null", folder_ / "null.csv");
  for (const auto& [name, message] : {std::pair{"dangling.csv", "dangling symbolic link"},
                                      {"round.csv", "dangling symbolic link"},
                                      {"null.csv", "not a regular file"}})
    EXPECT_THAT([&] { write_whole_file(folder_ / name, "new"); },
                ThrowsMessage<InputError>(HasSubstr(message)));
  EXPECT_THAT(names(), UnorderedElementsAre("dangling.csv", "round.csv", "null.csv"));
  EXPECT_TRUE(fs::is_symlink(folder_ / "null.csv"));
}

TEST_F(AtomicFiles, GiveAPipeTheContent) {
  const fs::path pipe = folder_ / "pipe.csv";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  check_writable(pipe);  // does not wait for who reads
  auto reading = std::async(std::launch::async, [&] { return read_bytes(pipe); });
  write_whole_file(pipe, "content");
  EXPECT_EQ(reading.get(), "content");
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_THAT(names(), ElementsAre("pipe.csv"));
}

TEST_F(AtomicFiles, AppendToWhatIsOpen) {
  write_bytes(folder_ / "log.csv", "before, ");
  const int open_file = open((folder_ / "log.csv").c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  // As /dev/stdout is: a link to /proc/self/fd/1.
  const std::string name = "/proc/self/fd/" + std::to_string(open_file);
  fs::create_symlink(name, folder_ / "open");
  write_whole_file(name, "one, ");
  write_whole_file(folder_ / "open", "two, ");
  write_whole_file("/dev/fd/" + std::to_string(open_file), "three");
  EXPECT_EQ(read_bytes(folder_ / "log.csv"), "before, one, two, three");
  EXPECT_TRUE(fs::is_symlink(folder_ / "open"));
  close(open_file);
  write_whole_file("/dev/null", "content");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

// ---- what others leave ------------------------------------------------------------------------------

TEST_F(AtomicFiles, RemoveWhatADeadProcessLeft) {
  die_writing(folder_ / "map.exr");
  die_writing(folder_ / "other.exr");
  write_bytes(folder_ / ".map.part.exr", "somebody else's");
  ASSERT_THAT(names(), testing::SizeIs(3));
  write_whole_file(folder_ / "map.exr", "");
  EXPECT_THAT(names(), UnorderedElementsAre("map.exr", ".map.part.exr", testing::StartsWith(".other.")));
}

TEST_F(AtomicFiles, LeaveWhatALiveOneWrites) {
  AtomicFile first(folder_ / "map.exr");
  first.write("first");
  write_whole_file(folder_ / "map.exr", "second");
  EXPECT_EQ(read_bytes(folder_ / "map.exr"), "second");
  first.commit();
  EXPECT_EQ(read_bytes(folder_ / "map.exr"), "first");
  EXPECT_THAT(names(), ElementsAre("map.exr"));
}

TEST_F(AtomicFiles, AreWholeHoweverManyWriteThem) {
  const auto writer = [&](char letter) {
    for (int i = 0; i < 50; ++i) write_whole_file(folder_ / "map.exr", std::string(9000, letter));
  };
  write_whole_file(folder_ / "map.exr", std::string(9000, 'a'));
  std::vector<std::jthread> writers;
  for (const char letter : {'a', 'b', 'c'}) writers.emplace_back(writer, letter);
  for (int i = 0; i < 200; ++i) {
    const std::string content = read_bytes(folder_ / "map.exr");
    ASSERT_EQ(content, std::string(9000, content.front()));
  }
  writers.clear();
  EXPECT_THAT(names(), ElementsAre("map.exr"));
}

// ---- a full disk ------------------------------------------------------------------------------------

TEST_F(AtomicFiles, SayWhatTheyTakeWhenTheDiskIsFull) {
  write_bytes(folder_ / "tree.json", "old");
  std::optional<FileSizeLimit> limit(100'000);
  EXPECT_THAT([&] { write_whole_file(folder_ / "tree.json", std::string(2'500'000, ' ')); },
              ThrowsMessage<Error>((folder_ / "tree.json").string() +
                                   ": could not be written completely (File too large); the disk may be "
                                   "full: make room for 2.5 MB"));
  limit.reset();
  EXPECT_THAT(names(), ElementsAre("tree.json"));
  EXPECT_EQ(read_bytes(folder_ / "tree.json"), "old");
}

// ---- several files ----------------------------------------------------------------------------------

TEST_F(AtomicFiles, OfASetAppearTogether) {
  write_bytes(folder_ / "a", "old");
  {
    OutputSet outputs;
    write_whole_file(folder_ / "a", "new");
    {
      OutputSet inner;
      write_whole_file(folder_ / "b", "new");
      inner.commit();
    }
    EXPECT_EQ(read_bytes(folder_ / "a"), "old");
    EXPECT_FALSE(fs::exists(folder_ / "b"));
    const int before = files_written();
    outputs.commit();
    EXPECT_EQ(files_written() - before, 2);
  }
  EXPECT_EQ(read_bytes(folder_ / "a") + read_bytes(folder_ / "b"), "newnew");
  EXPECT_THAT(names(), UnorderedElementsAre("a", "b"));
}

TEST_F(AtomicFiles, OfASetThatIsGivenUpAreRemoved) {
  {
    const OutputSet outputs;
    write_whole_file(folder_ / "a", "new");
  }
  EXPECT_THAT(names(), IsEmpty());
  write_whole_file(folder_ / "a", "alone");
  EXPECT_EQ(read_bytes(folder_ / "a"), "alone");
}

}  // namespace
}  // namespace xraycast::atomic_file_test
