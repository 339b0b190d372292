#include "progress_bar.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <unistd.h>

namespace xraycast::cli {
namespace {

constexpr int kWidth = 30;

std::string clock(double seconds) {
  const long s = std::lround(seconds);
  return s < 60 ? fmt::format("{} s", s) : fmt::format("{}:{:02} min", s / 60, s % 60);
}

}  // namespace

ProgressBar::ProgressBar(bool enabled) : enabled_(enabled && isatty(STDERR_FILENO) != 0) {}

void ProgressBar::show(const Progress::State& state) {
  if (!enabled_) return;
  const auto now = Clock::now();
  if (state.done == 0 || state.stage != stage_) {
    clear();
    stage_ = state.stage;
    stage_start_ = last_drawn_ = now;
  }
  if (state.done >= state.total) return clear();  // results follow
  const double elapsed_s = std::chrono::duration<double>(now - stage_start_).count();
  const bool too_soon = now - last_drawn_ < std::chrono::milliseconds(50);
  if (elapsed_s < 0.5 || too_soon || state.done <= 0) return;
  last_drawn_ = now;
  const double fraction = std::clamp(state.fraction(), 0.0, 1.0),
               rate = static_cast<double>(state.done) / elapsed_s;
  const auto filled = static_cast<std::size_t>(fraction * kWidth);
  const std::string bar = std::string(filled, '#') + std::string(kWidth - filled, '.');
  fmt::print(stderr, "\r\033[K{:<12} [{}] {:3.0f} %  {:.0f} {}/s  {} left", state.stage, bar, 100 * fraction,
             rate, state.unit, clock(static_cast<double>(state.total - state.done) / rate));
  std::fflush(stderr);
  drawn_ = true;
}

void ProgressBar::clear() {
  if (drawn_) fmt::print(stderr, "\r\033[K");
  drawn_ = false;
}

}  // namespace xraycast::cli
