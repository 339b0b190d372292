#include "xraycast/blood_flow/heartbeat.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kContraction_s = 0.05, kRelaxation_s = 0.08;

/// Weissler's, in seconds.
double weissler_s(double rate_bpm) {
  constexpr double kOutput_ml_min = 5000;
  const double stroke_ml = kOutput_ml_min / rate_bpm;
  return 0.266 + 0.0011 * (stroke_ml - 82) - 0.0009 * (rate_bpm - 73);
}

}  // namespace

Heartbeat::Heartbeat(double rate_bpm) {
  if (rate_bpm == 0) return;
  constexpr double kLongestShare = 0.6;  // of a beat; Weissler's line was fitted to 50 to 110 a minute
  period_s_ = 60 / rate_bpm;
  ejection_s_ = std::clamp(weissler_s(rate_bpm), 0.1, kLongestShare * period_s_);
}

Heartbeat::Heartbeat(const HeartWaveform& waveform) : period_s_(waveform.period_s()) {
  const double mean_ml_s = waveform.mean_ml_s();
  double ejected_s = 0;
  for (const HeartWaveform::Sample& sample : waveform.samples) {
    const double flow = sample.ml_s / mean_ml_s;
    if (!knots_.empty()) {
      const Knot& last = knots_.back();
      ejected_s += 0.5 * (last.flow + flow) * (sample.time_s - last.time_s);
    }
    knots_.push_back({sample.time_s, flow, ejected_s});
  }
  const auto peak = std::max_element(knots_.begin(), knots_.end(),
                                     [](const Knot& a, const Knot& b) { return a.flow < b.flow; });
  constexpr double kOfPeak = 0.1;
  constexpr int kSteps = 1000;
  const auto ejects = [&](double time_s) { return ejection(time_s) > kOfPeak * peak->flow; };
  const double step_s = period_s_ / kSteps;
  int before = 0, after = 0;
  while (before < kSteps && ejects(peak->time_s - (before + 1) * step_s)) ++before;
  while (before + after < kSteps && ejects(peak->time_s + (after + 1) * step_s)) ++after;
  begin_s_ = peak->time_s - before * step_s;
  ejection_s_ = std::max(before + after, 1) * step_s;
}

const Heartbeat::Knot& Heartbeat::knot_before(double phase_s) const {
  const auto after = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, phase_s,
                                      [](double time_s, const Knot& knot) { return time_s < knot.time_s; });
  return after[-1];
}

double Heartbeat::phase_s(double time_s) const { return time_s - period_s_ * std::floor(time_s / period_s_); }

double Heartbeat::ejection(double time_s) const {
  if (!knots_.empty()) {
    const double within_s = phase_s(time_s);
    const Knot &from = knot_before(within_s), &to = (&from)[1];
    return std::lerp(from.flow, to.flow, (within_s - from.time_s) / (to.time_s - from.time_s));
  }
  if (is_steady()) return 1;
  const double phase = phase_s(time_s) / ejection_s_;
  if (phase >= 1) return 0;
  return 0.5 * std::numbers::pi * period_s_ / ejection_s_ * std::sin(std::numbers::pi * phase);
}

/// The ejection's integral from 0 s on.
double Heartbeat::ejected(double time_s) const {
  const double beats = std::floor(time_s / period_s_);
  if (!knots_.empty()) {
    const double within_s = phase_s(time_s);
    const Knot& from = knot_before(within_s);
    return period_s_ * beats + from.ejected_s +
           0.5 * (from.flow + ejection(time_s)) * (within_s - from.time_s);
  }
  const double phase = std::min(phase_s(time_s) / ejection_s_, 1.0);
  return period_s_ * (beats + 0.5 * (1 - std::cos(std::numbers::pi * phase)));
}

double Heartbeat::mean_ejection(double begin_s, double end_s) const {
  if (is_steady() || begin_s == end_s) return ejection(begin_s);
  return (ejected(end_s) - ejected(begin_s)) / (end_s - begin_s);
}

double Heartbeat::contraction(double time_s) const {
  if (is_steady()) return 0;
  const double lasts_s = std::min(kContraction_s + ejection_s_ + kRelaxation_s, period_s_);
  const double phase = phase_s(time_s - begin_s_ + kContraction_s) / lasts_s;
  return phase < 1 ? std::sin(std::numbers::pi * phase) : 0;
}

}  // namespace xraycast
