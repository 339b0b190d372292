#include "xraycast/haptics/rate_limited_log.hpp"

#include <fmt/format.h>

namespace xraycast {
namespace {

constexpr std::chrono::seconds kQuiet{1};

}  // namespace

void RateLimitedLog::add(std::string_view topic, const std::string& line, Clock::time_point now) {
  flush(now);
  const auto [entry, is_new] = topics_.try_emplace(topic);
  Topic& state = entry->second;
  if (is_new || now - state.said >= kQuiet) {
    state.said = now;
    sink_(line);
  } else {
    ++state.held_back;
    state.line = line;
  }
}

void RateLimitedLog::flush(Clock::time_point now) {
  for (auto& [topic, state] : topics_) {
    if (state.held_back == 0 || now - state.said < kQuiet) continue;
    state.said = now;
    sink_(state.held_back == 1 ? state.line : fmt::format("{} ({} times)", state.line, state.held_back));
    state.held_back = 0;
  }
}

}  // namespace xraycast
