#include "xraycast/base/child_process.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/base/stopwatch.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <iostream>
#include <stdexcept>
#include <sys/mman.h>
#include <unistd.h>

namespace xraycast::child_process_test {
namespace {

constexpr ChildLimits kLimits{.memory_B = std::int64_t{256} << 20};

TEST(RunInChild, KeepsWhatIsShared) {
  const SharedMemory shared(100);
  int unshared = 1;
  EXPECT_TRUE(run_in_child(
      [&] {
        shared.bytes()[99] = std::byte{7};
        unshared = 2;
      },
      kLimits));
  EXPECT_EQ(shared.bytes()[99], std::byte{7});
  EXPECT_EQ(unshared, 1);
}

TEST(RunInChild, SurvivesWhateverHappensThere) {
  testing::internal::CaptureStderr();
  EXPECT_FALSE(run_in_child([] { throw std::runtime_error("no"); }, kLimits));
  EXPECT_FALSE(run_in_child([] { kill(getpid(), SIGSEGV); }, kLimits));
  EXPECT_FALSE(run_in_child([] { std::abort(); }, kLimits));
  EXPECT_TRUE(run_in_child([] { std::cerr << "words of a library" << std::endl; }, kLimits));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(RunInChild, EndsWhatTakesTooMuch) {
  const auto take = [](std::size_t size_B) {
    if (mmap(nullptr, size_B, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED)
      throw std::bad_alloc();
  };
  EXPECT_TRUE(run_in_child([&] { take(std::size_t{64} << 20); }, kLimits));
  EXPECT_FALSE(run_in_child([&] { take(std::size_t{1} << 30); }, kLimits));
  const Stopwatch waiting;
  EXPECT_FALSE(run_in_child([] { pause(); }, {.memory_B = kLimits.memory_B, .wall_s = 1}));
  EXPECT_FALSE(run_in_child(
      [] {
        for (;;) getpid();
      },
      {.memory_B = kLimits.memory_B, .processor_s = 1}));
  // A second each, and what a busy machine adds.
  EXPECT_LT(waiting.ms(), 30e3);
}

TEST(RunInChild, IsRunAgainWhereItStalls) {
  const SharedMemory shared(1);
  const auto stall = [&](int times) {
    shared.bytes()[0] = std::byte{0};
    return run_in_child(
        [&] {
          int run = std::to_integer<int>(shared.bytes()[0]);
          shared.bytes()[0] = static_cast<std::byte>(++run);
          if (run <= times) pause();
        },
        {.memory_B = kLimits.memory_B, .stall_s = 1});
  };
  EXPECT_TRUE(stall(1));
  EXPECT_EQ(shared.bytes()[0], std::byte{2});
  EXPECT_FALSE(stall(3));
  EXPECT_EQ(shared.bytes()[0], std::byte{3});
}

TEST(RunInChild, IsCalledByManyThreads) {
  constexpr std::size_t kCalls = 64;
  const SharedMemory shared(kCalls);
  parallel_for(kCalls, [&](std::int64_t i) {
    EXPECT_TRUE(run_in_child([&] { shared.bytes()[static_cast<std::size_t>(i)] = std::byte{1}; }, kLimits));
  });
  for (const std::byte byte : shared.bytes()) EXPECT_EQ(byte, std::byte{1});
}

}  // namespace
}  // namespace xraycast::child_process_test
