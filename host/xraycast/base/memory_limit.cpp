#include "xraycast/base/memory_limit.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <sys/resource.h>
#include <unistd.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kUnlimited = MemoryLimit::kUnlimited;

/// The number that a file starts with, or `otherwise`: for a file that is missing, or "max".
std::int64_t number_in(const fs::path& file, std::int64_t otherwise) {
  std::ifstream stream(file);
  std::int64_t value = 0;
  return stream >> value ? value : otherwise;
}

/// The sum of the fields of a file of names and numbers, as memory.stat and /proc/meminfo are.
std::int64_t sum_of_fields(const fs::path& file, std::initializer_list<std::string_view> names) {
  std::ifstream stream(file);
  std::int64_t sum = 0;
  for (std::string line; std::getline(stream, line);) {
    std::istringstream fields(line);
    std::string name;
    std::int64_t value = 0;
    if (fields >> name >> value && std::ranges::find(names, name) != names.end()) sum += value;
  }
  return sum;
}

/// The names of one version's files.
struct GroupFiles {
  std::string_view mount, limit, usage, active_cache, inactive_cache;
};
constexpr GroupFiles kVersion1{"sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes",
                               "total_active_file", "total_inactive_file"},
    kVersion2{"sys/fs/cgroup", "memory.max", "memory.current", "active_file", "inactive_file"};

/// The least that a group and those above it leave. In a container, the group's path may be the host's, and
/// the mount's own top the container's.
std::int64_t left_by_groups(const fs::path& root, const GroupFiles& files, const std::string& group) {
  std::int64_t left_B = kUnlimited;
  for (fs::path folder = fs::path(group).relative_path();; folder = folder.parent_path()) {
    const fs::path place = root / files.mount / folder;
    const std::int64_t limit_B = number_in(place / files.limit, kUnlimited);
    const std::int64_t cache_B =
        sum_of_fields(place / "memory.stat", {files.active_cache, files.inactive_cache});
    // The cache is counted by page and by group, and can exceed the usage, which is not exact.
    const std::int64_t taken_B = std::max<std::int64_t>(0, number_in(place / files.usage, 0) - cache_B);
    if (limit_B != kUnlimited) left_B = std::min(left_B, limit_B - taken_B);
    if (folder.empty()) return left_B;
  }
}

/// Each line of /proc/self/cgroup is `number:controllers:path`; version 2 has no controllers.
std::int64_t left_by_groups(const fs::path& root) {
  std::ifstream groups(root / "proc/self/cgroup");
  std::int64_t left_B = kUnlimited;
  for (std::string line; std::getline(groups, line);) {
    const auto first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1),
                      path = line.substr(second + 1);
    if (controllers.empty()) left_B = std::min(left_B, left_by_groups(root, kVersion2, path));
    if (controllers == "memory") left_B = std::min(left_B, left_by_groups(root, kVersion1, path));
  }
  return left_B;
}

void require(std::string_view purpose, std::int64_t need_B, const MemoryLimit& limit) {
  const auto megabytes = [](std::int64_t bytes) { return std::max<std::int64_t>(0, bytes) >> 20; };
  if (need_B > limit.left_B)
    throw Error("{} needs {} MB of memory, and {} leaves {} MB: raise that limit or close other programs",
                purpose, megabytes(need_B) + 1, limit.name, megabytes(limit.left_B));
}

}  // namespace

std::int64_t machine_memory_B() {
  return static_cast<std::int64_t>(sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::int64_t>(sysconf(_SC_PAGESIZE));
}

std::int64_t address_space_taken_B() { return number_in("/proc/self/statm", 0) * sysconf(_SC_PAGESIZE); }

MemoryLimit address_space_left() {
  MemoryLimit limit{kUnlimited, "`ulimit -v`"};
  rlimit most{};
  if (getrlimit(RLIMIT_AS, &most) != 0 || most.rlim_cur == RLIM_INFINITY) return limit;
  limit.left_B =
      static_cast<std::int64_t>(std::min<rlim_t>(most.rlim_cur, kUnlimited)) - address_space_taken_B();
  return limit;
}

MemoryLimit resident_memory_left(const fs::path& root) {
  constexpr std::int64_t kKilobyte = 1024;
  const std::int64_t machine_B =
      kKilobyte * sum_of_fields(root / "proc/meminfo", {"MemAvailable:", "SwapFree:"});
  const std::int64_t groups_B = left_by_groups(root);
  if (machine_B > 0 && machine_B < groups_B) return {machine_B, "this machine"};
  return {groups_B, "this process's control group (memory.max)"};
}

void require_memory(std::string_view purpose, const MemoryNeed& need) {
  require(purpose, need.address_space_B, address_space_left());
  require(purpose, need.resident_B, resident_memory_left());
}

}  // namespace xraycast
