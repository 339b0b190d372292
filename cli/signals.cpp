#include "signals.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stderr_log.hpp"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <limits>
#include <mutex>
#include <thread>
#include <unistd.h>

namespace xraycast::cli {
namespace {

std::atomic<int> first_signal{0};
std::mutex job_mutex;
Progress* job = nullptr;  ///< guarded by job_mutex

sigset_t watched_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, signal);
  return set;
}

/// Runs before the constructors of shared libraries, some of which start threads (OpenBLAS): every thread of
/// the process inherits the mask.
void block_watched_signals() {
  const sigset_t set = watched_signals();
  sigprocmask(SIG_BLOCK, &set, nullptr);
}
[[gnu::section(".preinit_array"),
  gnu::used]] void (*const kBlockBeforeConstructors)() = block_watched_signals;

bool is_ignored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

void watch(sigset_t set) {
  // What other libraries do cannot be cancelled, such as meshing and the compiling of kernels.
  timespec patience{1, 500'000'000};
  int written = 0;
  for (;;) {
    const bool is_first = first_signal == 0;
    const int signal = is_first ? sigwaitinfo(&set, nullptr) : sigtimedwait(&set, nullptr, &patience);
    const std::lock_guard lock(job_mutex);
    if (is_first && signal > 0) {
      first_signal = signal;
      written = files_written();
      if (job) job->cancel();
    } else if (signal < 0 && job && written < files_written()) {  // it has just done its work
      written = std::numeric_limits<int>::max();
      patience = {0, 400'000'000};
    } else if (signal > 0 || (errno == EAGAIN && job)) {
      if (signal < 0) log_to_stderr(cancelled_in_words());
      remove_temporary_files();
      _exit(kSignalStatus + (signal > 0 ? signal : first_signal.load()));
    }
  }
}

}  // namespace

SignalWatch::SignalWatch(Progress& progress) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  sigset_t set = watched_signals();
  if (is_ignored(SIGHUP)) sigdelset(&set, SIGHUP);
  job = &progress;
  std::thread(watch, set).detach();
}

SignalWatch::~SignalWatch() {
  const std::lock_guard lock(job_mutex);
  job = nullptr;
}

int SignalWatch::caught() { return first_signal; }

std::string cancelled_in_words() {
  const int files = files_written();
  return files == 0 ? "cancelled; no output was written"
                    : "cancelled after " + pluralize(files, "file") + " had been written";
}

}  // namespace xraycast::cli
