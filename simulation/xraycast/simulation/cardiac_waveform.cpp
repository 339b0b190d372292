#include "xraycast/simulation/cardiac_waveform.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kWindkessel_s = 0.79 * 1.75;
constexpr double kShareDownstream = 0.15;  // of the arterial compliance

/// Weissler's, in seconds.
double ejection_s(double heart_rate_bpm) {
  constexpr double kOutput_ml_min = 5000;
  const double stroke_ml = kOutput_ml_min / heart_rate_bpm;
  return 0.266 + 0.0011 * (stroke_ml - 82) - 0.0009 * (heart_rate_bpm - 73);
}

}  // namespace

CardiacWaveform::CardiacWaveform(double heart_rate_bpm) : heart_rate_bpm_(heart_rate_bpm) {
  if (heart_rate_bpm == 0) return;
  constexpr double kLongestShare = 0.6;  // of a beat; Weissler's line was fitted to 50 to 110 a minute
  period_s_ = 60 / heart_rate_bpm;
  ejection_s_ = std::clamp(ejection_s(heart_rate_bpm), 0.1, kLongestShare * period_s_);
  // The response to one beat from an empty windkessel, and what is left of it in all later beats.
  end_diastole_ = 0;
  const double after_one = windkessel(period_s_);
  end_diastole_ = after_one / (1 - std::exp(-period_s_ / kWindkessel_s));
  constexpr int kPhases = 1000;
  for (int i = 0; i < kPhases; ++i) peak_ = std::max(peak_, at(period_s_ * i / kPhases));
}

/// The outflow of a windkessel whose inflow is half a sine of mean 1, a linear equation's closed form.
double CardiacWaveform::windkessel(double phase_s) const {
  const double omega = std::numbers::pi / ejection_s_, tau = kWindkessel_s;
  const double inflow = 0.5 * omega * period_s_;  // the sine's amplitude
  const double systole_s = std::min(phase_s, ejection_s_);
  const double gain = inflow / (1 + omega * omega * tau * tau);
  const double fed = gain * (std::sin(omega * systole_s) - omega * tau * std::cos(omega * systole_s) +
                             omega * tau * std::exp(-systole_s / tau));
  return end_diastole_ * std::exp(-phase_s / tau) + fed * std::exp(-(phase_s - systole_s) / tau);
}

double CardiacWaveform::at(double time_s) const {
  if (ejection_s_ == 0) return 1;
  const double phase_s = time_s - period_s_ * std::floor(time_s / period_s_);
  double ejected = 0;
  if (phase_s < ejection_s_)
    ejected =
        0.5 * std::numbers::pi * period_s_ / ejection_s_ * std::sin(std::numbers::pi * phase_s / ejection_s_);
  return kShareDownstream * ejected + (1 - kShareDownstream) * windkessel(phase_s);
}

}  // namespace xraycast
