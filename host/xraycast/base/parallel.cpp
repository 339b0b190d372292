#include "xraycast/base/parallel.hpp"

#include "xraycast/base/progress.hpp"

#include <unistd.h>
#include <utility>

// Debian's oneTBB does not tell ThreadSanitizer how its threads wait for each other.
#if defined(__SANITIZE_THREAD__)
#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>
#else
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif

namespace xraycast {
namespace {

thread_local const Progress* cancelling = nullptr;

/// In a forked process oneTBB waits for threads that are its parent's.
bool is_forked() {
  static const pid_t first = getpid();
  return getpid() != first;
}

#if defined(__SANITIZE_THREAD__)
void run_all(std::int64_t count, const std::function<void(std::int64_t)>& item) {
  std::atomic<std::int64_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto run = [&] {
    try {
      for (std::int64_t i; (i = next++) < count;) item(i);
    } catch (...) {
      next = count;
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (std::int64_t i = 1; i < std::min<std::int64_t>(std::thread::hardware_concurrency(), count); ++i)
      helpers.emplace_back(run);
    run();
  }
  if (failure) std::rethrow_exception(failure);
}
#else
/// Where several processes share a machine, XRAYCAST_THREADS limits this one's, from its first loop on
/// OpenVDB's too.
std::unique_ptr<tbb::global_control> thread_limit() {
  const char* const words = std::getenv("XRAYCAST_THREADS");
  const int threads = words == nullptr ? 0 : std::atoi(words);
  if (threads <= 0) return nullptr;
  return std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                               static_cast<std::size_t>(threads));
}

void run_all(std::int64_t count, const std::function<void(std::int64_t)>& item) {
  static const std::unique_ptr<tbb::global_control> limit = thread_limit();
  // A loop within a loop runs to its end, also where another call of the outer one has failed.
  tbb::task_group_context own(tbb::task_group_context::isolated);
  // A thread that waits for the end of its loop takes no work of other loops, which may use its thread's
  // buffers.
  tbb::this_task_arena::isolate(
      [&] { tbb::parallel_for(std::int64_t{0}, count, item, tbb::simple_partitioner(), own); });
}
#endif

}  // namespace

CancelScope::CancelScope(const Progress* progress) : outer_(std::exchange(cancelling, progress)) {}

CancelScope::~CancelScope() { cancelling = outer_; }

const Progress* CancelScope::current() { return cancelling; }

void check_cancelled() {
  if (cancelling != nullptr) cancelling->check();
}

void parallel_for(std::int64_t count, const std::function<void(std::int64_t)>& work) {
  const std::function<void(std::int64_t)> item = [&, progress = CancelScope::current()](std::int64_t i) {
    const CancelScope scope(progress);
    check_cancelled();
    work(i);
  };
  if (!is_forked()) return run_all(count, item);
  for (std::int64_t i = 0; i < count; ++i) item(i);
}

}  // namespace xraycast
