#include "xraycast/motion/body_request.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/named_number.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

constexpr double kFastest = 100;

void check_without_motion(const BodyRequest& request) {
  const char* const field = !request.phase.empty() ? "phase"
                            : request.gate         ? "gate"
                            : request.speed != 1   ? "motion_speed"
                                                   : nullptr;
  if (field) throw InputError("`{}` needs a motion; give `motion` too, or leave it out", field);
}

std::size_t number_of_mode(const PhaseGate& gate, const Motion& motion) {
  return motion.number_of(gate.mode, fmt::format("`gate` {}={:g}", excerpt(gate.mode), gate.phase));
}

/// From a time on; nothing where it does not open any more.
std::optional<double> opening_s(const BodyRequest& request, double from_s) {
  const MotionMode& mode = request.motion->modes()[number_of_mode(*request.gate, *request.motion)];
  const double phase = request.gate->phase;
  if (const auto held = request.phase.find(mode.name); held != request.phase.end())
    return mode.is_same_phase(held->second, phase) ? std::optional(from_s) : std::nullopt;
  const auto wait_s = mode.wait_s(phase, request.speed * from_s, request.speed);
  return wait_s ? std::optional(from_s + *wait_s) : std::nullopt;
}

}  // namespace

void check(const BodyRequest& request) {
  if (!request.motion) return check_without_motion(request);
  request.motion->phases_of(request.phase);
  if (!(request.speed >= 0 && request.speed <= kFastest))
    throw InputError("`motion_speed` {:g}: must be 0 to {:g}", request.speed, kFastest);
  if (!request.gate) return;
  const PhaseGate& gate = *request.gate;
  number_of_mode(gate, *request.motion);
  if (!(gate.phase >= 0 && gate.phase <= 1))
    throw InputError("`gate` {}={:g}: the phase must be 0 to 1", gate.mode, gate.phase);
  if (!opening_s(request, 0))
    throw InputError("`gate` {0}={1:g}: {0} never has this phase; let it go on, or choose another one",
                     gate.mode, gate.phase);
}

std::vector<double> phases_at(const BodyRequest& request, double time_s) {
  if (!request.motion) return {};
  std::vector<double> phases = request.motion->phases_at(request.speed * time_s);
  for (std::size_t m = 0; m < phases.size(); ++m) {
    const auto held = request.phase.find(request.motion->modes()[m].name);
    if (held != request.phase.end()) phases[m] = held->second;
  }
  return phases;
}

BodyClock clock_of(const BodyRequest& request, double time_s) {
  BodyClock clock(*request.motion, request.speed * time_s);
  clock.set_speed(request.speed);
  for (const auto& [mode, phase] : request.phase) clock.hold(mode, phase);
  return clock;
}

double exposure_time_s(const BodyRequest& request, double due_s) {
  return request.gate ? opening_s(request, due_s).value_or(due_s) : due_s;
}

bool has_r_wave_between(const BodyRequest& request, double after_s, double until_s) {
  if (!request.motion || request.speed == 0 || request.phase.contains("heart")) return false;
  BodyRequest waiting = request;
  waiting.gate = PhaseGate{"heart", 0};
  if (std::ranges::find(request.motion->modes(), "heart", &MotionMode::name) == request.motion->modes().end())
    return false;
  constexpr double kSameWave_s = 1e-6;
  const auto next_s = opening_s(waiting, after_s + kSameWave_s);
  return next_s && *next_s <= until_s;
}

PhaseGate parse_gate(const std::string& text) {
  auto gate = parse_named_number<double>(text);
  if (!gate) throw InputError("`gate` {}: must be a mode and its phase, such as heart=0.75", excerpt(text));
  return {std::move(gate->first), gate->second};
}

}  // namespace xraycast
