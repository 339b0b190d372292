#include "xraycast/base/parallel.hpp"

#include "xraycast/base/progress.hpp"

#include <cstddef>
#include <cstdlib>
#include <mutex>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <utility>

namespace xraycast {
namespace {

thread_local const Progress* cancelling = nullptr;

/// Where several processes share a machine, XRAYCAST_THREADS limits this one's, OpenVDB's loops too.
void limit_threads() {
  const char* const words = std::getenv("XRAYCAST_THREADS");
  const int threads = words == nullptr ? 0 : std::atoi(words);
  if (threads <= 0) return;
  static const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                         static_cast<std::size_t>(threads));
}

}  // namespace

CancelScope::CancelScope(const Progress* progress) : outer_(std::exchange(cancelling, progress)) {}

CancelScope::~CancelScope() { cancelling = outer_; }

const Progress* CancelScope::current() { return cancelling; }

void check_cancelled() {
  if (cancelling != nullptr) cancelling->check();
}

void parallel_for(std::int64_t count, const std::function<void(std::int64_t)>& work) {
  static std::once_flag is_limited;
  std::call_once(is_limited, limit_threads);
  const auto run = [&, progress = CancelScope::current()] {
    tbb::parallel_for(
        std::int64_t{0}, count,
        [&](std::int64_t i) {
          const CancelScope scope(progress);
          check_cancelled();
          work(i);
        },
        tbb::simple_partitioner());
  };
  // A thread that waits for the end of its loop takes no work of other loops, which may use its thread's
  // buffers.
  tbb::this_task_arena::isolate(run);
}

}  // namespace xraycast
