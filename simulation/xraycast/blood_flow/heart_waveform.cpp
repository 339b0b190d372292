#include "xraycast/blood_flow/heart_waveform.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/blood_flow/heartbeat.hpp"

#include <cmath>

namespace xraycast {

double HeartWaveform::mean_ml_s() const {
  double ml = 0;
  for (std::size_t i = 1; i < samples.size(); ++i)
    ml += 0.5 * (samples[i - 1].ml_s + samples[i].ml_s) * (samples[i].time_s - samples[i - 1].time_s);
  return ml / period_s();
}

void check(const HeartWaveform& waveform, const std::string& origin) {
  const std::vector<HeartWaveform::Sample>& samples = waveform.samples;
  if (samples.size() < 2 || samples.size() > HeartWaveform::kMaxSamples)
    throw InputError(
        "{}: {} samples; a heart's waveform has 2 to {}, each a line of a time in s and a flow in ml/s",
        origin, samples.size(), HeartWaveform::kMaxSamples);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!std::isfinite(samples[i].time_s) || !(std::abs(samples[i].ml_s) <= HeartWaveform::kMaxFlow_ml_s))
      throw InputError("{}: sample {}: must be a time in s and a flow of at most {:g} ml/s", origin, i + 1,
                       HeartWaveform::kMaxFlow_ml_s);
    if (i == 0 ? samples[i].time_s != 0 : !(samples[i].time_s > samples[i - 1].time_s))
      throw InputError("{}: sample {}: {:g} s; times must ascend from 0 s", origin, i + 1, samples[i].time_s);
  }
  constexpr double kLeast_s = 60 / kMaxHeartRate_bpm, kMost_s = 60 / kMinHeartRate_bpm;
  constexpr double kRounding = 1 + 1e-9;
  const double period_s = waveform.period_s();
  if (!(period_s * kRounding >= kLeast_s && period_s <= kMost_s * kRounding))
    throw InputError("{}: lasts for {:g} s; a beat takes {:g} to {:g} s", origin, period_s, kLeast_s,
                     kMost_s);
  const double mean_ml_s = waveform.mean_ml_s();
  if (!(mean_ml_s >= HeartWaveform::kMinOutput_ml_s && mean_ml_s <= HeartWaveform::kMaxOutput_ml_s))
    throw InputError("{}: its mean is {:.3g} ml/s; a heart gives {:g} to {:g} ml/s{}", origin, mean_ml_s,
                     HeartWaveform::kMinOutput_ml_s, HeartWaveform::kMaxOutput_ml_s,
                     mean_ml_s < 0 ? ": turn the sign" : "");
}

}  // namespace xraycast
