#pragma once

#include "xraycast/serving/live_outlet.hpp"

#include <chrono>
#include <mutex>
#include <string_view>

namespace xraycast {

/// The hand of the browser that steers, from its messages on. Messages come on a server's thread; commands
/// are asked for on the session's.
class BrowserHand {
 public:
  using Clock = std::chrono::steady_clock;

  /// A browser that has said nothing for so long holds nothing any more.
  static constexpr std::chrono::milliseconds kSilence{1000};

  /// The table's travel is counted from this height of the body.
  explicit BrowserHand(double mid_height_mm) : mid_height_mm_(mid_height_mm) {}

  /// A message: a JSON object (docs/web.md). False where it is none, or a value is not what it must be;
  /// nothing changes then. Fields with other names are passed over.
  bool receive(std::string_view text, Clock::time_point now);

  /// Lets go of everything: the browser has left.
  void let_go();

  LiveCommands commands(Clock::time_point now);

 private:
  double mid_height_mm_;
  std::mutex mutex_;  ///< of what follows
  LiveCommands commands_;
  Clock::time_point received_;
};

}  // namespace xraycast
