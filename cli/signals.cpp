#include "signals.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stderr_log.hpp"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <thread>
#include <unistd.h>

namespace xraycast::cli {
namespace {

std::atomic<int> cancelling_signal{0};
std::mutex job_mutex;
Progress* job = nullptr;  ///< guarded by job_mutex; none where it has ended, or its last file has its name

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

int next_of(const sigset_t& set) {
  int signal = -1;
  while (signal < 0) signal = sigwaitinfo(&set, nullptr);
  return signal;
}

/// Cancels the job, unless it has all its files.
void cancel_on(int signal) {
  const std::lock_guard lock(job_mutex);
  if (job && !close_outputs()) job = nullptr;
  if (!job) return;
  cancelling_signal = signal;
  job->cancel();
}

void watch(sigset_t set) {
  cancel_on(next_of(set));
  for (;;) {
    // What other libraries do cannot be cancelled, such as meshing and the compiling of kernels.
    constexpr timespec kPatience{1, 500'000'000};
    const int signal = sigtimedwait(&set, nullptr, &kPatience);
    const bool is_too_late = signal < 0 && errno == EAGAIN;
    const std::lock_guard lock(job_mutex);
    if (is_too_late && job && !abandon_outputs()) job = nullptr;
    if (is_too_late && job) {
      log_to_stderr(cancelled_in_words());
      _exit(kSignalStatus + cancelling_signal);
    }
    if (signal > 0) {
      abandon_outputs();
      _exit(kSignalStatus + signal);
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

void SignalWatch::end_job() {
  const std::lock_guard lock(job_mutex);
  job = nullptr;
}

int SignalWatch::caught() { return cancelling_signal; }

std::string cancelled_in_words() {
  const int files = files_written();
  return files == 0 ? "cancelled; no output was written"
                    : "cancelled after " + pluralize(files, "file") + " had been written";
}

}  // namespace xraycast::cli
