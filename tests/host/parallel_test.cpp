#include "xraycast/base/parallel.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace xraycast::parallel_test {
namespace {

TEST(ParallelFor, CallsEachOnce) {
  std::vector<std::atomic<int>> calls(1000);
  parallel_for(1000, [&](std::int64_t i) { ++calls[static_cast<std::size_t>(i)]; });
  for (const std::atomic<int>& count : calls) EXPECT_EQ(count, 1);
}

TEST(ParallelFor, ThrowsWhatACallThrows) {
  EXPECT_THROW(parallel_for(100,
                            [](std::int64_t i) {
                              if (i == 50) throw std::out_of_range("fifty");
                            }),
               std::out_of_range);
}

/// A loop that returns has made all of its calls, also where another call of the loop around it has thrown.
TEST(ParallelFor, WithinAnotherRunsToItsEnd) {
  for (int run = 0; run < 20; ++run) {
    std::atomic<bool> has_thrown = false, has_begun = false;
    std::atomic<int> calls = 0, returned_after = 1000;
    // Both calls run at once, if there are threads for them.
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(1);
    const auto wait_for = [&](const std::atomic<bool>& happened) {
      while (!happened && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    };
    const auto inner = [&](std::int64_t) {
      has_begun = true;
      wait_for(has_thrown);
      ++calls;
    };
    EXPECT_THROW(parallel_for(2,
                              [&](std::int64_t i) {
                                if (i == 0) {
                                  parallel_for(1000, inner);
                                  returned_after = calls.load();
                                  return;
                                }
                                wait_for(has_begun);
                                has_thrown = true;
                                throw std::runtime_error("the other one");
                              }),
                 std::runtime_error);
    EXPECT_EQ(returned_after, 1000);
  }
}

/// Its parent's threads are not the child's.
TEST(ParallelFor, RunsInAForkedProcess) {
  parallel_for(100, [](std::int64_t) {});
  const pid_t child = fork();
  if (child == 0) {
    alarm(20);  // else a loop that waits for ever would
    int calls = 0;
    parallel_for(100, [&](std::int64_t) { ++calls; });
    _exit(calls == 100 ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

}  // namespace
}  // namespace xraycast::parallel_test
