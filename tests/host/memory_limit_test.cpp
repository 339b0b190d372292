#include "xraycast/base/memory_limit.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

namespace xraycast::memory_limit_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// Control groups as Linux shows them, below a folder of its own.
class ControlGroups : public testing::Test {
 protected:
  void put(const std::string& path, const std::string& content) const {
    const std::filesystem::path file = folder_ / path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << content;
  }
  MemoryLimit left() const { return resident_memory_left(folder_ / ""); }
  TemporaryFolder folder_;
};

TEST_F(ControlGroups, OfVersion2LeaveWhatTheTightestOfThemLeaves) {
  put("proc/self/cgroup", "0::/a/b\n");
  put("sys/fs/cgroup/a/b/memory.max", "max\n");
  put("sys/fs/cgroup/a/b/memory.current", "100\n");
  put("sys/fs/cgroup/a/memory.max", "5000\n");
  put("sys/fs/cgroup/a/memory.current", "3000\n");
  put("sys/fs/cgroup/a/memory.stat", "anon 2300\nactive_file 400\ninactive_file 300\n");
  EXPECT_EQ(left().left_B, 5000 - 3000 + 700);  // files in the cache give way
  EXPECT_THAT(left().name, HasSubstr("control group"));
}

TEST_F(ControlGroups, OfVersion1AreReadToo) {
  put("proc/self/cgroup", "4:cpu,cpuacct:/\n3:memory:/c\n0::/\n");
  put("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");  // what it says for none
  put("sys/fs/cgroup/memory/c/memory.limit_in_bytes", "4096\n");
  put("sys/fs/cgroup/memory/c/memory.usage_in_bytes", "4000\n");
  put("sys/fs/cgroup/memory/c/memory.stat", "total_active_file 10\ntotal_inactive_file 20\n");
  EXPECT_EQ(left().left_B, 96 + 30);
}

TEST_F(ControlGroups, LeaveAllWhereTheirCacheExceedsTheirUsage) {
  put("proc/self/cgroup", "4:memory:/c\n");
  put("sys/fs/cgroup/memory/c/memory.limit_in_bytes", "9223372036854771712\n");
  put("sys/fs/cgroup/memory/c/memory.usage_in_bytes", "1000\n");
  put("sys/fs/cgroup/memory/c/memory.stat", "total_active_file 90000\ntotal_inactive_file 90000\n");
  EXPECT_EQ(left().left_B, 9223372036854771712);
}

TEST_F(ControlGroups, OfAContainerLieAtTheTopOfItsMount) {
  put("proc/self/cgroup", "0::/system.slice/container\n");  // the host's path, which is not mounted here
  put("sys/fs/cgroup/memory.max", "1000\n");
  put("sys/fs/cgroup/memory.current", "400\n");
  EXPECT_EQ(left().left_B, 600);
}

TEST_F(ControlGroups, LeaveNoMoreThanTheMachineHas) {
  put("proc/self/cgroup", "0::/\n");
  put("sys/fs/cgroup/memory.max", "1048576\n");
  put("proc/meminfo", "MemTotal: 9000 kB\nMemAvailable:  100 kB\nSwapFree:  50 kB\n");
  EXPECT_EQ(left().left_B, 150 * 1024);
  EXPECT_EQ(left().name, "this machine");
}

TEST_F(ControlGroups, ThatDoNotExistOrMakeNoSenseLimitNothing) {
  EXPECT_FALSE(left().is_limited());
  put("proc/self/cgroup", "\n:\n0::\n::::\n4:memory:../../..\n");
  put("sys/fs/cgroup/memory.max", "-\n");
  EXPECT_FALSE(left().is_limited());
}

TEST(AddressSpace, ShrinksByWhatIsMapped) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  rlimit limited = before;
  // Sanitizers map terabytes.
  std::int64_t taken_pages = 0;
  std::ifstream("/proc/self/statm") >> taken_pages;
  limited.rlim_cur = static_cast<rlim_t>(taken_pages * sysconf(_SC_PAGESIZE)) + (rlim_t{4} << 30);
  ASSERT_EQ(setrlimit(RLIMIT_AS, &limited), 0);
  constexpr std::size_t kMapped_B = std::size_t{256} << 20;
  const std::int64_t left_B = address_space_left().left_B;
  void* mapped = mmap(nullptr, kMapped_B, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  EXPECT_NE(mapped, MAP_FAILED);
  // What other mappings come and go meanwhile is far less.
  EXPECT_NEAR(static_cast<double>(left_B - address_space_left().left_B), kMapped_B, kMapped_B / 8.0);
  EXPECT_THAT(
      [&] {
        require_memory("a test", {left_B, 0});
      },
      testing::ThrowsMessage<Error>(AllOf(HasSubstr("a test needs"), HasSubstr("`ulimit -v` leaves"))));
  EXPECT_NO_THROW(require_memory("a test", {kMapped_B / 4, 0}));
  munmap(mapped, kMapped_B);
  setrlimit(RLIMIT_AS, &before);
}

}  // namespace
}  // namespace xraycast::memory_limit_test
