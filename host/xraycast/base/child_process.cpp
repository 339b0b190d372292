#include "xraycast/base/child_process.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <new>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

/// Lowers a limit; an already lower one is kept.
void limit(__rlimit_resource resource, rlim_t most) {
  rlimit now{};
  getrlimit(resource, &now);
  now.rlim_cur = std::min(now.rlim_cur, most);
  setrlimit(resource, &now);
}

/// In the new process.
[[noreturn]] void work_apart(const std::function<void()>& work, const ChildLimits& limits, rlim_t most_B) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // Ctrl-C reaches all processes of a terminal; the one that waits decides.
  std::signal(SIGINT, SIG_IGN);
  for (const int crash : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTERM}) std::signal(crash, SIG_DFL);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<rlim_t>(limits.processor_s));
  limit(RLIMIT_AS, most_B);
  if (const int nowhere = open("/dev/null", O_WRONLY); nowhere >= 0) dup2(nowhere, STDERR_FILENO);
  try {
    work();
  } catch (...) {
    _exit(1);
  }
  _exit(0);
}

enum class Ending { success, failure, stall };

/// The processor's time that a process has taken. 0 when it has ended.
std::int64_t processor_time_ns(pid_t process) {
  clockid_t clock = 0;
  timespec taken{};
  if (clock_getcpuclockid(process, &clock) != 0 || clock_gettime(clock, &taken) != 0) return 0;
  return std::int64_t{taken.tv_sec} * 1'000'000'000 + taken.tv_nsec;
}

/// Waits until the process has ended; ends it when it stands still or takes too long.
Ending wait_for(pid_t process, const ChildLimits& limits) {
  bool stalls = false;
  // glibc 2.36's pidfd_open() cannot be called from C++.
  const auto ended = static_cast<int>(syscall(SYS_pidfd_open, process, 0));
  if (ended >= 0) {
    pollfd waited{ended, POLLIN, 0};
    std::int64_t taken_ns = -1;
    for (int waited_s = 0; !stalls;) {
      const int next_s = std::min(limits.stall_s, limits.wall_s - waited_s);
      const int ready = poll(&waited, 1, next_s * 1000);
      if (ready < 0 && errno == EINTR) continue;
      if (ready != 0) break;
      waited_s += next_s;
      const std::int64_t now_ns = processor_time_ns(process);
      stalls = now_ns == std::exchange(taken_ns, now_ns);
      if (stalls || waited_s >= limits.wall_s) {
        kill(process, SIGKILL);
        break;
      }
    }
    close(ended);
  }
  int status = 0;
  pid_t found = 0;
  while ((found = waitpid(process, &status, 0)) < 0 && errno == EINTR) {
  }
  if (found == process && WIFEXITED(status) && WEXITSTATUS(status) == 0) return Ending::success;
  return stalls ? Ending::stall : Ending::failure;
}

}  // namespace

SharedMemory::SharedMemory(std::size_t size_B) {
  void* const memory = mmap(nullptr, size_B, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  bytes_ = {static_cast<std::byte*>(memory), size_B};
}

SharedMemory::~SharedMemory() { munmap(bytes_.data(), bytes_.size()); }

bool run_in_child(const std::function<void()>& work, const ChildLimits& limits) {
  const auto most_B = static_cast<rlim_t>(address_space_taken_B() + limits.memory_B);
  // A copy that waits for a lock which another thread held when it was made waits for ever; the next one
  // hardly does.
  constexpr int kMaxTries = 3;
  Ending ending = Ending::stall;
  for (int i = 0; i < kMaxTries && ending == Ending::stall; ++i) {
    const pid_t process = fork();
    if (process < 0) throw Error("no process can be started: {}; close other programs", std::strerror(errno));
    if (process == 0) work_apart(work, limits, most_B);
    ending = wait_for(process, limits);
  }
  return ending == Ending::success;
}

}  // namespace xraycast
