#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>

namespace xraycast {

/// How much more memory this process may take, and what sets that limit.
struct MemoryLimit {
  std::int64_t left_B = 0;
  std::string name;  ///< as in "... leaves 12 MB": "`ulimit -v`"
  bool is_limited() const { return left_B != kUnlimited; }
  static constexpr std::int64_t kUnlimited = std::numeric_limits<std::int64_t>::max();
};

/// All of this machine's memory, used or free.
std::int64_t machine_memory_B();

/// How much of the address space this process has mapped.
std::int64_t address_space_taken_B();

/// What `ulimit -v` (RLIMIT_AS) leaves of the address space.
MemoryLimit address_space_left();

/// What the control groups of this process leave (memory.max of version 2, memory.limit_in_bytes of version
/// 1, in every group up to the root; the file cache counts as free), or this machine's memory where that is
/// less. The files lie below `root`, which only tests change.
MemoryLimit resident_memory_left(const std::filesystem::path& root = "/");

/// The memory that a task takes in addition to what the process has now.
struct MemoryNeed {
  std::int64_t address_space_B = 0;  ///< with what is only reserved, such as a thread's stack
  std::int64_t resident_B = 0;
};

/// Throws Error, one line, when a limit leaves less than `need` for `purpose`, such as "drawing". Call it
/// before: LLVM and Mesa abort a process that runs out of memory, and a control group kills it.
void require_memory(std::string_view purpose, const MemoryNeed& need);

}  // namespace xraycast
