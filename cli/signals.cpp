#include "signals.hpp"

#include "xraycast/base/atomic_file.hpp"

#include <atomic>
#include <csignal>
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
  for (;;) {
    int signal = 0;
    if (sigwait(&set, &signal) != 0) continue;
    int none = 0;
    const std::lock_guard lock(job_mutex);
    if (!first_signal.compare_exchange_strong(none, signal)) {
      remove_temporary_files();
      _exit(kSignalStatus + signal);
    }
    if (job) job->cancel();
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

}  // namespace xraycast::cli
