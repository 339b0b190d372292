#include "xraycast/serving/live_body.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"

#include <algorithm>
#include <chrono>
#include <sstream>
#include <thread>
#include <utility>

namespace xraycast {
namespace {

const BodyRequest& checked_body(const BodyRequest& request) {
  if (!request.motion) throw InputError("`motion`: missing; the body is still");
  check(request);
  return request;
}

[[noreturn]] void refuse_change(const std::string& text) {
  throw InputError(
      "'{}': must be 'hold MODE', 'hold MODE PHASE', 'release MODE', 'speed FACTOR', 'gate MODE PHASE' or "
      "'gate off'",
      excerpt(text));
}

double number_in(const std::string& word, const std::string& text) {
  double number = 0;
  if (!parse_whole(word, number)) refuse_change(text);
  return number;
}

}  // namespace

void BodyChanges::add(const BodyChanges& later) {
  for (const auto& [mode, hold] : later.holds) holds[mode] = hold;
  if (later.speed) speed = later.speed;
  if (later.gate) gate = later.gate;
}

BodyChanges parse_body_changes(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  const std::string verb = words.empty() ? "" : words[0];
  BodyChanges changes;
  if (verb == "hold" && (words.size() == 2 || words.size() == 3)) {
    BodyChanges::Hold& hold = changes.holds[words[1]];
    if (words.size() == 3) hold.phase = number_in(words[2], text);
  } else if (verb == "release" && words.size() == 2) {
    changes.holds[words[1]].is_held = false;
  } else if (verb == "speed" && words.size() == 2) {
    changes.speed = number_in(words[1], text);
  } else if (verb == "gate" && words.size() == 2 && words[1] == "off") {
    changes.gate.emplace();
  } else if (verb == "gate" && words.size() == 3) {
    changes.gate = PhaseGate{words[1], number_in(words[2], text)};
  } else {
    refuse_change(text);
  }
  return changes;
}

LiveBody::LiveBody(const BodyRequest& request)
    : motion_(checked_body(request).motion),
      clock_(clock_of(request)),
      phases_(clock_.phases()),
      speed_(request.speed),
      gate_(request.gate) {
  traces_.samples.resize(phases_.size());
}

std::span<const double> LiveBody::advance(double seconds) {
  const std::lock_guard lock(mutex_);
  clock_.advance(seconds);
  phases_ = clock_.phases();
  return phases_;
}

double LiveBody::time_s() const {
  const std::lock_guard lock(mutex_);
  return clock_.time_s();
}

std::vector<double> LiveBody::phases() const {
  const std::lock_guard lock(mutex_);
  return clock_.phases();
}

std::vector<double> LiveBody::phases_at(double time_s) const {
  const std::lock_guard lock(mutex_);
  return clock_.phases_at(time_s);
}

std::vector<BodyModeState> LiveBody::modes() const {
  const std::lock_guard lock(mutex_);
  const std::vector<double> phases = clock_.phases();
  std::vector<BodyModeState> modes;
  for (const std::string& name : clock_.names())
    modes.push_back({name, clock_.is_held(name), phases[modes.size()]});
  return modes;
}

void LiveBody::change(const BodyChanges& changes) {
  const std::lock_guard lock(mutex_);
  sample();
  for (const auto& [mode, hold] : changes.holds) {
    if (!hold.is_held)
      clock_.release(mode);
    else if (hold.phase)
      clock_.hold(mode, *hold.phase);
    else
      clock_.hold(mode);
  }
  if (changes.speed) {
    clock_.set_speed(*changes.speed);
    speed_ = *changes.speed;
  }
  if (!changes.gate) return;
  if (const auto& gate = *changes.gate) clock_.next_instant(gate->mode, gate->phase, clock_.time_s());
  gate_ = *changes.gate;
  looked_s_ = clock_.time_s();
}

void LiveBody::toggle_hold(const std::string& mode) {
  const bool is_held = [&] {
    const std::lock_guard lock(mutex_);
    return clock_.is_held(mode);
  }();
  change({.holds = {{mode, {.is_held = !is_held}}}});
}

std::optional<double> LiveBody::exposure_s(double patience_s) {
  constexpr double kBehind_s = 1e-8;  // of an opening that was seen
  std::optional<double> opening_s;
  double now_s = 0;
  {
    const std::lock_guard lock(mutex_);
    now_s = clock_.time_s();
    const double from_s = std::exchange(looked_s_, now_s + kBehind_s);
    if (!gate_) return now_s;
    opening_s = clock_.next_instant(gate_->mode, gate_->phase, from_s);
    if (opening_s == from_s) return now_s;  // the mode is held there
  }
  if (!opening_s || *opening_s > now_s + patience_s + kBehind_s) return std::nullopt;
  if (*opening_s > now_s) looked_s_ = wait_until(*opening_s, 2 * patience_s) + kBehind_s;
  return opening_s;
}

/// Returns the time then. A simulation that stands still, as while instruments are exchanged, ends it.
double LiveBody::wait_until(double until_s, double longest_s) const {
  using Clock = std::chrono::steady_clock;
  const auto latest = Clock::now() + std::chrono::duration<double>(longest_s);
  while (time_s() < until_s && Clock::now() < latest)
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  return std::max(until_s, time_s());
}

bool LiveBody::opens_again() const {
  const std::lock_guard lock(mutex_);
  return !gate_ || clock_.next_instant(gate_->mode, gate_->phase, clock_.time_s());
}

const BodyTraces& LiveBody::traces() {
  const std::lock_guard lock(mutex_);
  sample();
  return traces_;
}

void LiveBody::mark_exposure(double time_s) {
  const std::lock_guard lock(mutex_);
  traces_.exposures_s.push_back(time_s);
  forget_exposures();
}

/// Those that no monitor shows any more, also where there is none.
void LiveBody::forget_exposures() {
  const double oldest_s = clock_.time_s() - BodyTraces::kKept_s;
  while (!traces_.exposures_s.empty() && traces_.exposures_s.front() < oldest_s)
    traces_.exposures_s.pop_front();
}

/// What has passed since the last samples; holds and speeds were what they are now.
void LiveBody::sample() {
  const double now_s = clock_.time_s();
  traces_.end_s = std::max(traces_.end_s, now_s - BodyTraces::kKept_s);
  while (traces_.end_s + BodyTraces::kStep_s <= now_s) {
    traces_.end_s += BodyTraces::kStep_s;
    ++traces_.count;
    const std::vector<double> values = clock_.traces_at(traces_.end_s);
    for (std::size_t m = 0; m < values.size(); ++m)
      traces_.samples[m].push_back(static_cast<float>(values[m]));
  }
  constexpr auto kKept = static_cast<std::size_t>(BodyTraces::kKept_s / BodyTraces::kStep_s);
  for (std::deque<float>& samples : traces_.samples)
    while (samples.size() > kKept) samples.pop_front();
  forget_exposures();
}

}  // namespace xraycast
