#include "xraycast/base/temporary_folder_on_disk.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <vector>

namespace {
/// What flock answers instead of locking; 0: it locks.
int no_lock = 0;
}  // namespace

/// Takes the place of the C library's in this program.
extern "C" int flock(int file, int operation) noexcept {
  if (no_lock == 0) return static_cast<int>(syscall(SYS_flock, file, operation));
  errno = no_lock;
  return -1;
}

namespace xraycast::temporary_folder_on_disk_test {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;
using testing::UnorderedElementsAreArray;

class TemporaryFoldersOnDisk : public testing::Test {
 protected:
  TemporaryFoldersOnDisk() { setenv("TMPDIR", (folder_ / "").c_str(), 1); }
  ~TemporaryFoldersOnDisk() override {
    no_lock = 0;
    if (before_.empty())
      unsetenv("TMPDIR");
    else
      setenv("TMPDIR", before_.c_str(), 1);
  }
  void make(const std::string& name, mode_t mode) const {
    fs::create_directory(folder_ / name);
    fs::create_directory(folder_ / name / "content");
    chmod((folder_ / name).c_str(), mode);
  }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder_ / "")) all.push_back(entry.path().filename());
    return all;
  }

  const std::string before_ = std::getenv("TMPDIR") ? std::getenv("TMPDIR") : "";
  TemporaryFolder folder_;
};

TEST_F(TemporaryFoldersOnDisk, ArePrivateAndGoWithTheirContent) {
  {
    const TemporaryFolderOnDisk made("kind-");
    EXPECT_THAT(made.path().filename().string(), testing::MatchesRegex("kind-[0-9a-f]+"));
    struct stat status {};
    ASSERT_EQ(stat(made.path().c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0700U);
    fs::create_directory(made.path() / "content");
    const TemporaryFolderOnDisk another("kind-");
    EXPECT_TRUE(fs::exists(made.path())) << "one in use was removed";
  }
  EXPECT_THAT(names(), IsEmpty());
}

TEST_F(TemporaryFoldersOnDisk, RemoveWhatWasAbandonedAndNothingElse) {
  make("kind-0123456789abcdef", 0700);
  const std::vector<std::string> of_the_user{"kind-notes",
                                             "kind-photos",
                                             "kind-",
                                             "kind-0123456789ABCDEF",
                                             "kind-0123456789abcdef0",
                                             "kind-0123456789abcde",
                                             "other-0123456789abcdef"};
  for (const std::string& name : of_the_user) make(name, 0700);
  make("kind-1123456789abcdef", 0755);
  const TemporaryFolderOnDisk made("kind-");
  std::vector<std::string> expected = of_the_user;
  expected.insert(expected.end(), {"kind-1123456789abcdef", made.path().filename().string()});
  EXPECT_THAT(names(), UnorderedElementsAreArray(expected));
  for (const std::string& name : of_the_user) EXPECT_TRUE(fs::exists(folder_ / name / "content")) << name;
}

TEST_F(TemporaryFoldersOnDisk, DoWithoutLocksWhereTheFileSystemHasNone) {
  for (const int reason : {EBADF, ENOSYS, EOPNOTSUPP}) {
    no_lock = reason;
    {
      const TemporaryFolderOnDisk made("kind-");
      const TemporaryFolderOnDisk another("kind-");
      EXPECT_TRUE(fs::exists(made.path())) << reason;
      EXPECT_EQ(names().size(), 2U) << reason;
    }
    EXPECT_THAT(names(), IsEmpty()) << reason;
  }
}

TEST_F(TemporaryFoldersOnDisk, RefuseWhereOthersHoldEachNewOne) {
  no_lock = EWOULDBLOCK;
  EXPECT_THROW(TemporaryFolderOnDisk("kind-"), Error);
}

TEST_F(TemporaryFoldersOnDisk, NeedAFolderThatIsThere) {
  setenv("TMPDIR", (folder_ / "none").c_str(), 1);
  EXPECT_THROW(TemporaryFolderOnDisk("kind-"), Error);
  EXPECT_THAT(names(), IsEmpty());
}

}  // namespace
}  // namespace xraycast::temporary_folder_on_disk_test
