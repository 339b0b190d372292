#include "xraycast/motion/motion.hpp"
#include "xraycast/motion/phase_weights.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace xraycast {
namespace {

/// The index of the interval between ascending values that holds `value`: of the last one not above it.
template <typename Samples, typename Of>
std::size_t interval_of(const Samples& samples, double value, Of of) {
  const auto is_below = [&](double below, const auto& sample) { return below < std::invoke(of, sample); };
  const auto above = std::upper_bound(samples.begin(), samples.end(), value, is_below) - samples.begin();
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
class Waveform {
 public:
  explicit Waveform(const std::vector<PhaseSample>& samples)
      : samples_(samples),
        repeats_s_(samples.back().time_s - samples.front().time_s),
        growth_(samples.back().phase - samples.front().phase) {}

  double at(double time_s) const {
    const Place place = place_of(time_s);
    return piece_at(place.piece, place.time_s) + place.turns * growth_;
  }

  /// The first time from `from_s` on at which the phase is `phase`, or differs by a whole number where it
  /// wraps.
  std::optional<double> next(double phase, double from_s, bool wraps) const {
    Place place = place_of(from_s);
    // Once through all pieces, and the first of them from its start.
    for (std::size_t pieces = 0; pieces <= samples_.size() - 1; ++pieces) {
      const double end_s = samples_[place.piece + 1].time_s;
      const double sought = phase - place.turns * growth_;
      if (const auto found_s = next_in_piece(place.piece, sought, place.time_s, end_s, wraps))
        return *found_s + place.turns * repeats_s_;
      if (++place.piece == samples_.size() - 1) {
        place.piece = 0;
        place.turns += 1;
      }
      place.time_s = samples_[place.piece].time_s;
    }
    return {};
  }

 private:
  /// A piece between two samples, a time within it, and the repetitions before.
  struct Place {
    std::size_t piece;
    double time_s, turns;
  };

  Place place_of(double time_s) const {
    const double first_s = samples_.front().time_s, turns = std::floor((time_s - first_s) / repeats_s_);
    const double within_s = std::clamp(time_s - turns * repeats_s_, first_s, samples_.back().time_s);
    return {interval_of(samples_, within_s, &PhaseSample::time_s), within_s, turns};
  }

  double length_s(std::size_t piece) const { return samples_[piece + 1].time_s - samples_[piece].time_s; }
  double secant(std::size_t piece) const {
    return (samples_[piece + 1].phase - samples_[piece].phase) / length_s(piece);
  }

  double piece_at(std::size_t piece, double time_s) const {
    const std::size_t pieces = samples_.size() - 1;
    const auto slope = [&](std::size_t before, std::size_t after) {
      return monotone_slope(secant(before), length_s(before), secant(after), length_s(after));
    };
    const Hermite h((time_s - samples_[piece].time_s) / length_s(piece));
    return samples_[piece].phase * h.value0 + samples_[piece + 1].phase * h.value1 +
           length_s(piece) * (slope((piece + pieces - 1) % pieces, piece) * h.slope0 +
                              slope(piece, (piece + 1) % pieces) * h.slope1);
  }

  /// By bisection, for a piece is monotone.
  std::optional<double> next_in_piece(std::size_t piece, double phase, double start_s, double end_s,
                                      bool wraps) const {
    constexpr double kRounding = 1e-12;
    const double at_start = piece_at(piece, start_s), at_end = samples_[piece + 1].phase;
    const double direction = at_end < at_start ? -1 : 1;
    // The first in the way, of those that are a whole number away.
    const double target =
        wraps ? phase + direction * std::ceil(direction * (at_start - phase) - kRounding) : phase;
    const double to_go = direction * (target - at_start);
    if (to_go < -kRounding || to_go > direction * (at_end - at_start) + kRounding) return {};
    if (to_go <= kRounding) return start_s;
    double before_s = start_s, after_s = end_s;
    for (int step = 0; step < 60; ++step) {
      const double middle_s = 0.5 * (before_s + after_s);
      (direction * (piece_at(piece, middle_s) - target) < 0 ? before_s : after_s) = middle_s;
    }
    return after_s;
  }

  const std::vector<PhaseSample>& samples_;
  double repeats_s_, growth_;
};

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
  const double phase = Waveform(waveform).at(time_s);
  return wraps() ? phase - std::floor(phase) : std::clamp(phase, 0.0, 1.0);
}

std::optional<double> MotionMode::next_time_s(double phase, double from_s) const {
  if (!waveform.empty()) return Waveform(waveform).next(phase, from_s, wraps());
  // The shares of a period at which the phase is this one, once or on the way there and back.
  const double there =
      wraps() ? phase - std::floor(phase) : std::acos(1 - 2 * phase) / (2 * std::numbers::pi);
  const double back = wraps() ? there : 1 - there;
  const auto first_from = [&](double share) {
    return period_s * (std::ceil(from_s / period_s - share) + share);
  };
  return std::min(first_from(there), first_from(back));
}

bool MotionMode::is_same_phase(double a, double b) const {
  constexpr double kSame = 1e-9;
  const double away = std::abs(a - b);
  return away < kSame || (wraps() && 1 - away < kSame);
}

std::optional<double> MotionMode::wait_s(double phase, double own_s, double rate) const {
  constexpr double kJustBefore_s = 1e-9;
  if (rate == 0) return is_same_phase(phase_at(own_s), phase) ? std::optional(0.0) : std::nullopt;
  const std::optional<double> found_s = next_time_s(phase, own_s - kJustBefore_s * rate);
  if (!found_s) return {};
  return std::max(0.0, (*found_s - own_s) / rate);
}

std::vector<double> MotionMode::weights_at(double phase) const {
  const bool is_cycle = wraps();
  // The keys of one cycle; one at phase 1 is that at 0.
  const bool is_first_at_end = is_cycle && keys.front().phase == 0 && keys.back().phase == 1;
  std::vector<double> phases;
  for (const KeyPhase& key : keys) phases.push_back(key.phase);
  if (is_first_at_end) phases.pop_back();
  std::vector<double> weights = phase_weights(phases, is_cycle, phase);
  weights.resize(keys.size());
  return weights;
}

std::vector<double> phase_weights(std::span<const double> phases, bool wraps, double phase) {
  std::vector<double> weights(phases.size());
  const std::ptrdiff_t count = std::ssize(phases);
  const auto index = [&](std::ptrdiff_t k) { return static_cast<std::size_t>((k % count + count) % count); };
  const auto phase_of = [&](std::ptrdiff_t k) {
    return phases[index(k)] + std::floor(static_cast<double>(k) / static_cast<double>(count));
  };
  std::ptrdiff_t below = 0;
  if (wraps) {
    if (phase < phases.front()) phase += 1;
    while (below + 1 < count && phase_of(below + 1) <= phase) ++below;
  } else {
    below = static_cast<std::ptrdiff_t>(interval_of(phases, phase, std::identity{}));
  }
  const double start = phase_of(below), length = phase_of(below + 1) - start;
  const Hermite h((phase - start) / length);
  weights[index(below)] += h.value0;
  weights[index(below + 1)] += h.value1;
  // The slope at a phase is that from the one before to the one after; at an end of those that do not wrap,
  // that of the interval.
  const auto add_slope = [&](std::ptrdiff_t key, double weight) {
    const std::ptrdiff_t before = wraps || key > 0 ? key - 1 : key,
                         after = wraps || key + 1 < count ? key + 1 : key;
    const double per_phase = weight * length / (phase_of(after) - phase_of(before));
    weights[index(after)] += per_phase;
    weights[index(before)] -= per_phase;
  };
  add_slope(below, h.slope0);
  add_slope(below + 1, h.slope1);
  return weights;
}

}  // namespace xraycast
