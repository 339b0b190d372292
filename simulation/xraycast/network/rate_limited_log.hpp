#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace xraycast {

/// A log for events that may happen a thousand times a second. Of each topic the first line is written at
/// once; those within a second after it are counted, and the count is written when the second is over.
class RateLimitedLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Sink = std::function<void(const std::string& line)>;

  explicit RateLimitedLog(Sink sink) : sink_(std::move(sink)) {}

  /// `topic` is a string literal: it is kept by reference.
  void add(std::string_view topic, const std::string& line, Clock::time_point now);

  /// Writes the counts of topics whose second is over. To be called periodically.
  void flush(Clock::time_point now);

 private:
  struct Topic {
    Clock::time_point written;
    std::string line;              ///< the newest suppressed one
    std::uint64_t suppressed = 0;  ///< since `written`
  };
  Sink sink_;
  std::map<std::string_view, Topic> topics_;
};

}  // namespace xraycast
