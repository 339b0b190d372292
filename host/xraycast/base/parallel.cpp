#include "xraycast/base/parallel.hpp"

#include "xraycast/base/progress.hpp"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace xraycast {
namespace {

thread_local const Progress* cancelling = nullptr;

/// All cores, or what XRAYCAST_THREADS says, where several processes share a machine.
std::int64_t most_threads() {
  if (const char* limit = std::getenv("XRAYCAST_THREADS"))
    if (const int count = std::atoi(limit); count > 0) return count;
  return static_cast<std::int64_t>(std::thread::hardware_concurrency());
}

}  // namespace

CancelScope::CancelScope(const Progress* progress) : outer_(std::exchange(cancelling, progress)) {}

CancelScope::~CancelScope() { cancelling = outer_; }

const Progress* CancelScope::current() { return cancelling; }

void check_cancelled() {
  if (cancelling != nullptr) cancelling->check();
}

void parallel_for(std::int64_t count, const std::function<void(std::int64_t)>& work) {
  std::atomic<std::int64_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto run = [&, progress = CancelScope::current()] {
    const CancelScope scope(progress);
    try {
      for (std::int64_t i; (i = next++) < count;) {
        check_cancelled();
        work(i);
      }
    } catch (...) {
      next = count;
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (std::int64_t i = 1, threads = std::min(most_threads(), count); i < threads; ++i)
      helpers.emplace_back(run);
    run();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace xraycast
