#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace xraycast {

/// Lines for people about what may happen a thousand times a second. Of each topic the first line appears at
/// once; those within a second after it are counted, and the count appears when the second is over.
class RateLimitedLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Sink = std::function<void(const std::string& line)>;

  explicit RateLimitedLog(Sink sink) : sink_(std::move(sink)) {}

  /// `topic` is a literal: it is kept by reference, and there are few.
  void add(std::string_view topic, const std::string& line, Clock::time_point now);

  /// Says how many lines were held back, where their second is over. To be called now and then.
  void flush(Clock::time_point now);

 private:
  struct Topic {
    Clock::time_point said;
    std::string line;             ///< the newest held back
    std::uint64_t held_back = 0;  ///< since `said`
  };
  Sink sink_;
  std::map<std::string_view, Topic> topics_;
};

}  // namespace xraycast
