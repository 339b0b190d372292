#include "xraycast/network/rate_limited_log.hpp"

#include <fmt/format.h>

namespace xraycast {
namespace {

constexpr std::chrono::seconds kInterval{1};

}  // namespace

void RateLimitedLog::add(std::string_view topic, const std::string& line, Clock::time_point now) {
  flush(now);
  const auto [entry, is_new] = topics_.try_emplace(topic);
  Topic& state = entry->second;
  if (is_new || now - state.written >= kInterval) {
    state.written = now;
    sink_(line);
  } else {
    ++state.suppressed;
    state.line = line;
  }
}

void RateLimitedLog::flush(Clock::time_point now) {
  for (auto& [topic, state] : topics_) {
    if (state.suppressed == 0 || now - state.written < kInterval) continue;
    state.written = now;
    sink_(state.suppressed == 1 ? state.line : fmt::format("{} ({} times)", state.line, state.suppressed));
    state.suppressed = 0;
  }
}

}  // namespace xraycast
