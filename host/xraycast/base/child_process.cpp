#include "xraycast/base/child_process.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <new>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

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

/// Ends the process if it takes too long. Returns whether it succeeded.
bool wait_for(pid_t process, const ChildLimits& limits) {
  // glibc 2.36's pidfd_open() cannot be called from C++.
  const auto ended = static_cast<int>(syscall(SYS_pidfd_open, process, 0));
  if (ended >= 0) {
    pollfd waited{ended, POLLIN, 0};
    int ready = 0;
    while ((ready = poll(&waited, 1, limits.wall_s * 1000)) < 0 && errno == EINTR) {
    }
    if (ready == 0) kill(process, SIGKILL);
    close(ended);
  }
  int status = 0;
  pid_t found = 0;
  while ((found = waitpid(process, &status, 0)) < 0 && errno == EINTR) {
  }
  return found == process && WIFEXITED(status) && WEXITSTATUS(status) == 0;
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
  const pid_t process = fork();
  if (process < 0) throw Error("no process can be started: {}; close other programs", std::strerror(errno));
  if (process == 0) work_apart(work, limits, most_B);
  return wait_for(process, limits);
}

}  // namespace xraycast
