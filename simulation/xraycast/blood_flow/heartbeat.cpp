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

double Heartbeat::phase_s(double time_s) const { return time_s - period_s_ * std::floor(time_s / period_s_); }

double Heartbeat::ejection(double time_s) const {
  if (is_steady()) return 1;
  const double phase = phase_s(time_s) / ejection_s_;
  if (phase >= 1) return 0;
  return 0.5 * std::numbers::pi * period_s_ / ejection_s_ * std::sin(std::numbers::pi * phase);
}

/// The ejection's integral from 0 s on.
double Heartbeat::ejected(double time_s) const {
  const double beats = std::floor(time_s / period_s_);
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
  const double phase = phase_s(time_s + kContraction_s) / lasts_s;
  return phase < 1 ? std::sin(std::numbers::pi * phase) : 0;
}

}  // namespace xraycast
