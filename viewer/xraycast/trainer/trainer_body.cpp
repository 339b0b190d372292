#include "xraycast/trainer/trainer_body.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

const std::string& name_at(const std::vector<std::string>& names, std::size_t mode) {
  if (mode >= names.size()) throw InputError("the body has no mode {}", mode);
  return names[mode];
}

}  // namespace

TrainerBody::TrainerBody(std::shared_ptr<const Motion> motion)
    : motion_(std::move(motion)),
      clock_(*motion_),
      names_(clock_.names()),
      phases_(clock_.phases()),
      traces_(names_.size()) {}

std::span<const double> TrainerBody::advance(double seconds) {
  clock_.advance(seconds);
  phases_ = clock_.phases();
  return phases_;
}

void TrainerBody::hold(std::size_t mode, std::optional<double> phase) {
  sample();
  if (phase)
    clock_.hold(name_at(names_, mode), *phase);
  else
    clock_.hold(name_at(names_, mode));
}

void TrainerBody::release(std::size_t mode) {
  sample();
  clock_.release(name_at(names_, mode));
}

void TrainerBody::set_speed(double factor) {
  sample();
  clock_.set_speed(factor);
  speed_ = factor;
}

void TrainerBody::set_gate(const std::optional<Gate>& gate) {
  if (gate) clock_.next_instant(name_at(names_, gate->mode), gate->phase, clock_.time_s());
  gate_ = gate;
  looked_s_ = clock_.time_s();
}

std::optional<std::vector<double>> TrainerBody::exposure_phases() {
  constexpr double kBehind_s = 1e-8;  // of an opening that was seen
  const double now_s = clock_.time_s(), from_s = std::exchange(looked_s_, now_s + kBehind_s);
  if (!gate_) return phases_;
  const std::optional<double> opening_s = clock_.next_instant(names_[gate_->mode], gate_->phase, from_s);
  if (!opening_s || *opening_s > now_s + kBehind_s) return std::nullopt;
  return clock_.phases_at(*opening_s);
}

void TrainerBody::mark_exposure() { exposures_s_.push_back(clock_.time_s()); }

void TrainerBody::tell(BrowserMessage& message) {
  sample();
  message.body_time_s = sampled_s_;
  message.body_speed = speed_;
  message.modes.resize(names_.size());
  for (std::size_t m = 0; m < names_.size(); ++m) {
    BrowserMessage::Mode& mode = message.modes[m];
    mode.is_held = clock_.is_held(names_[m]);
    mode.is_gate = gate_ && gate_->mode == m;
    mode.gate = mode.is_gate ? gate_->phase : 0;
    mode.trace = std::exchange(traces_[m], {});
  }
  message.exposures_s = std::exchange(exposures_s_, {});
}

/// What has passed since the last samples; holds and speeds were what they are now.
void TrainerBody::sample() {
  const double now_s = clock_.time_s();
  sampled_s_ = std::max(sampled_s_, now_s - kKept_s);
  while (sampled_s_ + kTrace_s <= now_s) {
    sampled_s_ += kTrace_s;
    const std::vector<double> values = clock_.traces_at(sampled_s_);
    for (std::size_t m = 0; m < values.size(); ++m) traces_[m].push_back(static_cast<float>(values[m]));
  }
}

}  // namespace xraycast
