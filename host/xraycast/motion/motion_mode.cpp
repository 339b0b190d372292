#include "xraycast/motion/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

/// The index of the interval between ascending values that holds `value`: of the last one not above it.
template <typename Samples, typename Of>
std::size_t interval_of(const Samples& samples, double value, Of of) {
  const auto above = std::ranges::upper_bound(samples, value, {}, of) - samples.begin();
  return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above - 1, 0, std::ssize(samples) - 2));
}

/// Cubic Hermite functions of the ends' values, and of the ends' slopes times the interval.
struct Hermite {
  double value0, slope0, value1, slope1;
  explicit Hermite(double t)
      : value0((1 + 2 * t) * (1 - t) * (1 - t)),
        slope0(t * (1 - t) * (1 - t)),
        value1(t * t * (3 - 2 * t)),
        slope1(t * t * (t - 1)) {}
};

/// The slope of a waveform at a sample, between a secant before and one after it: weighted harmonic mean, as
/// Fritsch and Butland (SIAM J. Sci. Stat. Comput. 1984) have it; 0 at an extreme.
double monotone_slope(double before, double before_s, double after, double after_s) {
  if (before * after <= 0) return 0;
  const double w1 = 2 * after_s + before_s, w2 = after_s + 2 * before_s;
  return (w1 + w2) / (w1 / before + w2 / after);
}

/// Repeats with the time from the first to the last sample; the phase grows as much in each repetition.
double waveform_at(const std::vector<PhaseSample>& samples, double time_s) {
  const double first_s = samples.front().time_s, repeats_s = samples.back().time_s - first_s;
  const double turns = std::floor((time_s - first_s) / repeats_s);
  const double growth = samples.back().phase - samples.front().phase;
  const double time_of_first_s = std::clamp(time_s - turns * repeats_s, first_s, samples.back().time_s);
  const std::size_t i = interval_of(samples, time_of_first_s, &PhaseSample::time_s);
  const std::size_t intervals = samples.size() - 1;
  const auto length_s = [&](std::size_t k) { return samples[k + 1].time_s - samples[k].time_s; };
  const auto secant = [&](std::size_t k) { return (samples[k + 1].phase - samples[k].phase) / length_s(k); };
  const auto slope = [&](std::size_t before, std::size_t after) {
    return monotone_slope(secant(before), length_s(before), secant(after), length_s(after));
  };
  const Hermite h((time_of_first_s - samples[i].time_s) / length_s(i));
  return samples[i].phase * h.value0 + samples[i + 1].phase * h.value1 +
         length_s(i) * (slope((i + intervals - 1) % intervals, i) * h.slope0 +
                        slope(i, (i + 1) % intervals) * h.slope1) +
         turns * growth;
}

}  // namespace

bool MotionMode::wraps() const {
  const bool has_both_ends = keys.front().phase == 0 && keys.back().phase == 1;
  return !has_both_ends || keys.front().moves == keys.back().moves;
}

double MotionMode::phase_at(double time_s) const {
  if (waveform.empty()) {
    const double turns = time_s / period_s, share = turns - std::floor(turns);
    return wraps() ? share : 0.5 * (1 - std::cos(2 * std::numbers::pi * share));
  }
  const double phase = waveform_at(waveform, time_s);
  return wraps() ? phase - std::floor(phase) : std::clamp(phase, 0.0, 1.0);
}

std::vector<double> MotionMode::weights_at(double phase) const {
  std::vector<double> weights(keys.size());
  const bool is_cycle = wraps();
  // The keys of one cycle; one at phase 1 is that at 0.
  const bool is_first_at_end = is_cycle && keys.front().phase == 0 && keys.back().phase == 1;
  const std::ptrdiff_t count = std::ssize(keys) - (is_first_at_end ? 1 : 0);
  const auto index = [&](std::ptrdiff_t k) { return static_cast<std::size_t>((k % count + count) % count); };
  const auto phase_of = [&](std::ptrdiff_t k) {
    return keys[index(k)].phase + std::floor(static_cast<double>(k) / static_cast<double>(count));
  };
  std::ptrdiff_t below = 0;
  if (is_cycle) {
    if (phase < keys.front().phase) phase += 1;
    while (below + 1 < count && phase_of(below + 1) <= phase) ++below;
  } else {
    below = static_cast<std::ptrdiff_t>(interval_of(keys, phase, &KeyPhase::phase));
  }
  const double start = phase_of(below), length = phase_of(below + 1) - start;
  const Hermite h((phase - start) / length);
  weights[index(below)] += h.value0;
  weights[index(below + 1)] += h.value1;
  // The slope at a key is that from the key before to the key after; at an end of a mode that does not wrap,
  // that of the interval.
  const auto add_slope = [&](std::ptrdiff_t key, double weight) {
    const std::ptrdiff_t before = is_cycle || key > 0 ? key - 1 : key,
                         after = is_cycle || key + 1 < count ? key + 1 : key;
    const double per_phase = weight * length / (phase_of(after) - phase_of(before));
    weights[index(after)] += per_phase;
    weights[index(before)] -= per_phase;
  };
  add_slope(below, h.slope0);
  add_slope(below + 1, h.slope1);
  return weights;
}

}  // namespace xraycast
