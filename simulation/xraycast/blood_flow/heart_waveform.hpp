#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// What a heart ejects into the aorta over a beat, as phase-contrast MRI or an ultrasonic probe measures it.
struct HeartWaveform {
  struct Sample {
    double time_s = 0, ml_s = 0;  ///< below 0 blood flows back
  };
  /// With linear interpolation; the first one is at 0 s, and after the last one the beat begins anew.
  std::vector<Sample> samples;

  static constexpr double kMinOutput_ml_s = 1, kMaxOutput_ml_s = 1000;  ///< a newborn's is some 10
  static constexpr double kMaxFlow_ml_s = 5000;
  static constexpr std::size_t kMaxSamples = 100'000;

  double period_s() const { return samples.back().time_s; }
  double mean_ml_s() const;

  /// The first time becomes 0 s. Throws InputError as check().
  static HeartWaveform of(std::vector<Sample> samples, const std::string& origin);

  /// Two columns, time in s and flow in ml/s, separated by commas or blanks, after a line of names or without
  /// one. Throws InputError, naming `origin` and the line, for everything else, and as of().
  static HeartWaveform parse(const std::string& text, const std::string& origin);
  static HeartWaveform read(const std::filesystem::path& path);
};

/// Throws InputError, with `origin` in front, for fewer than two samples or more than kMaxSamples, numbers
/// that are not finite or beyond kMaxFlow_ml_s, times that do not ascend from 0 s, a period of no heart (see
/// kMinHeartRate_bpm), and a mean that is not kMinOutput_ml_s to kMaxOutput_ml_s.
void check(const HeartWaveform& waveform, const std::string& origin);

}  // namespace xraycast
