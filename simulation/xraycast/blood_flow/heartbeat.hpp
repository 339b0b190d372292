#pragma once

#include "xraycast/blood_flow/heart_waveform.hpp"

#include <vector>

namespace xraycast {

inline constexpr double kMinHeartRate_bpm = 20, kMaxHeartRate_bpm = 250;

/// What the left ventricle gives over a heartbeat.
///
/// Without a waveform the ejection is half a sine over the ejection time of Weissler et al., Am Heart J
/// 62:367, 1961, for a cardiac output of 5 l/min. The pressure of the ventricle's wall is half a sine too: it
/// begins to rise as the valve is still closed, 50 ms before the ejection, and is over when the ventricle has
/// relaxed, 80 ms after it (isovolumic times of a heart at rest: Klabunde, Cardiovascular Physiology
/// Concepts, 2011).
class Heartbeat {
 public:
  /// Beats per minute, within the limits above; 0: steady flow.
  explicit Heartbeat(double rate_bpm);
  /// Of a waveform that check() accepts. The ejection lasts for as long as the flow about its peak is above a
  /// tenth of it.
  explicit Heartbeat(const HeartWaveform& waveform);

  /// The flow through the aortic valve relative to its mean, at a time, of which 0 is the beginning of an
  /// ejection, or of the waveform.
  double ejection(double time_s) const;
  /// Its mean between two times, the first not above the second.
  double mean_ejection(double begin_s, double end_s) const;

  /// The ventricle's pressure at that time, from 0 in diastole to 1.
  double contraction(double time_s) const;

  double period_s() const { return period_s_; }  ///< without beats 1 s
  double ejection_s() const { return ejection_s_; }
  bool is_steady() const { return ejection_s_ == 0; }

 private:
  double phase_s(double time_s) const;
  double ejected(double time_s) const;

  /// Of a waveform: the flow relative to its mean from a time on, and its integral up to that.
  struct Knot {
    double time_s, flow, ejected_s;
  };
  const Knot& knot_before(double phase_s) const;

  double period_s_ = 1, ejection_s_ = 0, begin_s_ = 0;  ///< begin_s_: of the ejection
  std::vector<Knot> knots_;                             ///< without a waveform none
};

}  // namespace xraycast
