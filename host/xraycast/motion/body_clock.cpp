#include "xraycast/motion/body_clock.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

constexpr double kRounding_s = 1e-9;

/// A wave of the ECG: where it lies about the R wave, how wide and how high it is.
struct Wave {
  double angle, width, height;
};
/// P, Q, R, S, T. The heights are a b^2 of the model, whose equation of motion these Gaussians solve but for
/// its slow return to the base line.
constexpr std::array<Wave, 5> kWaves{{{-std::numbers::pi / 3, 0.25, 1.2 * 0.25 * 0.25},
                                      {-std::numbers::pi / 12, 0.1, -5 * 0.1 * 0.1},
                                      {0, 0.1, 30 * 0.1 * 0.1},
                                      {std::numbers::pi / 12, 0.1, -7.5 * 0.1 * 0.1},
                                      {std::numbers::pi / 2, 0.4, 0.75 * 0.4 * 0.4}}};

double sum_of_waves(double heart_phase) {
  double sum = 0;
  for (const Wave& wave : kWaves) {
    const double turns = heart_phase - wave.angle / (2 * std::numbers::pi);
    const double away = 2 * std::numbers::pi * (turns - std::round(turns)) / wave.width;
    sum += wave.height * std::exp(-0.5 * away * away);
  }
  return sum;
}

/// The least and the greatest sum, at the S and the R wave.
std::pair<double, double> extremes() {
  constexpr int kSamples = 10000;
  std::pair<double, double> found{sum_of_waves(0), sum_of_waves(0)};
  for (int i = 1; i < kSamples; ++i) {
    const double sum = sum_of_waves(static_cast<double>(i) / kSamples);
    found = {std::min(found.first, sum), std::max(found.second, sum)};
  }
  return found;
}

void check_phase(const std::string& mode, double phase) {
  if (!(phase >= 0 && phase <= 1)) throw InputError("`phase` {}={}: must be 0 to 1", mode, phase);
}

void check_speed(double factor) {
  constexpr double kFastest = 100;
  if (!(factor >= 0 && factor <= kFastest))
    throw InputError("`speed` {}: must be 0 to {:g}", factor, kFastest);
}

}  // namespace

double ecg(double heart_phase) {
  static const std::pair<double, double> range = extremes();
  const auto [least, greatest] = range;
  return std::clamp((sum_of_waves(heart_phase) - least) / (greatest - least), 0.0, 1.0);
}

BodyClock::BodyClock(const Motion& motion, double start_s) : time_s_(start_s) {
  for (const MotionMode& mode : motion.modes()) modes_.push_back({mode, start_s});
}

void BodyClock::advance(double seconds) {
  for (Mode& mode : modes_) mode.time_s += mode.rate() * seconds;
  time_s_ += seconds;
}

std::vector<double> BodyClock::phases_at(double time_s) const {
  std::vector<double> phases;
  for (const Mode& mode : modes_) phases.push_back(mode.motion.phase_at(own_time_s(mode, time_s)));
  return phases;
}

std::vector<double> BodyClock::traces_at(double time_s) const {
  std::vector<double> traces = phases_at(time_s);
  for (std::size_t m = 0; m < modes_.size(); ++m)
    if (modes_[m].motion.name == "heart") traces[m] = ecg(traces[m]);
  return traces;
}

std::vector<std::string> BodyClock::names() const {
  std::vector<std::string> names;
  for (const Mode& mode : modes_) names.push_back(mode.motion.name);
  return names;
}

void BodyClock::hold(const std::string& mode) { modes_[index_of(mode)].is_held = true; }

void BodyClock::hold(const std::string& mode, double phase) {
  check_phase(mode, phase);
  Mode& held = modes_[index_of(mode)];
  const std::optional<double> own_s = held.motion.next_time_s(phase, held.time_s - kRounding_s);
  if (!own_s)
    throw InputError("`phase` {}={}: its waveform never has this phase; choose another one", mode, phase);
  held.time_s = *own_s;
  held.is_held = true;
}

void BodyClock::release(const std::string& mode) { modes_[index_of(mode)].is_held = false; }

bool BodyClock::is_held(const std::string& mode) const { return modes_[index_of(mode)].is_held; }

void BodyClock::set_speed(const std::string& mode, double factor) {
  check_speed(factor);
  modes_[index_of(mode)].speed = factor;
}

void BodyClock::set_speed(double factor) {
  check_speed(factor);
  for (Mode& mode : modes_) mode.speed = factor;
}

std::optional<double> BodyClock::next_instant(const std::string& mode, double phase,
                                              double at_or_after_s) const {
  check_phase(mode, phase);
  const Mode& gate = modes_[index_of(mode)];
  const auto wait_s = gate.motion.wait_s(phase, own_time_s(gate, at_or_after_s), gate.rate());
  return wait_s ? std::optional(at_or_after_s + *wait_s) : std::nullopt;
}

std::size_t BodyClock::index_of(const std::string& name) const {
  const auto found =
      std::find_if(modes_.begin(), modes_.end(), [&](const Mode& mode) { return mode.motion.name == name; });
  if (found == modes_.end()) refuse_mode(excerpt(name), "the body", names());
  return static_cast<std::size_t>(found - modes_.begin());
}

}  // namespace xraycast
