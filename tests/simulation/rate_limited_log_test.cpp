#include "xraycast/network/rate_limited_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace xraycast::rate_limited_log_test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;

class RateLimitedLogTest : public testing::Test {
 protected:
  std::vector<std::string> lines() { return std::exchange(lines_, {}); }
  RateLimitedLog::Clock::time_point now_{1h};
  std::vector<std::string> lines_;
  RateLimitedLog log_{[this](const std::string& line) { lines_.push_back(line); }};
};

TEST_F(RateLimitedLogTest, SaysTheFirstOfEachTopicAtOnce) {
  log_.add("a", "one", now_);
  log_.add("b", "two", now_);
  EXPECT_THAT(lines(), ElementsAre("one", "two"));
}

TEST_F(RateLimitedLogTest, CountsTheRestOfTheSecond) {
  log_.add("a", "first", now_);
  for (int i = 0; i < 1000; ++i) log_.add("a", "more", now_ + 1ms * i);
  EXPECT_THAT(lines(), ElementsAre("first"));
  log_.flush(now_ + 999ms);
  EXPECT_THAT(lines(), IsEmpty());
  log_.flush(now_ + 1s);
  EXPECT_THAT(lines(), ElementsAre("more (1000 times)"));
  log_.flush(now_ + 10s);
  EXPECT_THAT(lines(), IsEmpty());
}

TEST_F(RateLimitedLogTest, SaysASingleLineHeldBackAsItIs) {
  log_.add("a", "one", now_);
  log_.add("a", "two", now_ + 1ms);
  log_.add("b", "three", now_ + 2s);
  EXPECT_THAT(lines(), ElementsAre("one", "two", "three"));
}

TEST_F(RateLimitedLogTest, StaysQuietUnderALastingFlood) {
  for (int ms = 0; ms < 10000; ++ms) log_.add("a", "flood", now_ + 1ms * ms);
  // The first, then a count a second.
  EXPECT_EQ(lines().size(), 10);
}

}  // namespace
}  // namespace xraycast::rate_limited_log_test
