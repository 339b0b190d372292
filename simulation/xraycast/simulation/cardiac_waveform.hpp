#pragma once

namespace xraycast {

inline constexpr double kMinHeartRate_bpm = 20, kMaxHeartRate_bpm = 250;

/// The flow in an artery over a heartbeat, relative to its mean.
///
/// A share of the arterial compliance lies downstream of any artery, and takes in that share of the heart's
/// ejection; the rest comes from the elastic aorta, which empties through the peripheral resistance (the
/// windkessel of Frank, 1899). The ejection is half a sine over the ejection time of Weissler et al., Am
/// Heart J 62:367, 1961; the windkessel's time constant is 1.4 s (0.79 mmHg s/ml times 1.75 ml/mmHg:
/// Stergiopulos et al., Am J Physiol 276:H81, 1999). The share is such that the resistive index (peak less
/// end-diastolic over peak) at rest is 0.6, a normal renal artery's (Tublin et al., AJR 180:885, 2003). The
/// flow is never retrograde.
class CardiacWaveform {
 public:
  /// Beats per minute, within the limits above, for a cardiac output of 5 l/min; 0: steady flow.
  explicit CardiacWaveform(double heart_rate_bpm);

  /// At a time, of which 0 is the beginning of an ejection.
  double at(double time_s) const;

  /// The largest value.
  double peak() const { return peak_; }

  double heart_rate_bpm() const { return heart_rate_bpm_; }

 private:
  double windkessel(double phase_s) const;

  double heart_rate_bpm_, period_s_ = 1, ejection_s_ = 0, end_diastole_ = 1, peak_ = 1;
};

}  // namespace xraycast
