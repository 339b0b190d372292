#include "xraycast/motion/moving_points.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/motion/phase_weights.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

constexpr std::size_t kBlock = 1536;   ///< numbers that are interpolated together, in the first-level cache
constexpr std::size_t kMostKeys = 33;  ///< of a mode; halving ends with twice as many at most
constexpr double kLargest = std::numeric_limits<std::int16_t>::max();

/// The phases at which a mode has displacements, one of each cycle.
std::vector<double> phases_of(const MotionMode& mode) {
  std::vector<double> phases;
  for (const KeyPhase& key : mode.keys)
    if (!mode.wraps() || key.phase < 1 || phases.empty()) phases.push_back(key.phase);
  // A spline needs two.
  if (phases.size() == 1) phases = {0, 0.5};
  return phases;
}

/// Where a place of the scan is; none where the motion folds.
std::optional<glm::dvec3> undone(const HeldMotion& motion, const glm::dvec3& place_mm,
                                 const glm::dvec3& guess_mm) {
  for (const glm::dvec3& start_mm : {guess_mm, place_mm})
    if (const InverseResult found = motion.inverse_mm(place_mm, start_mm); found.is_found) return found.x_mm;
  return {};
}

}  // namespace

/// Some of the places, while one mode moves alone.
struct MovingPoints::Sample {
  std::vector<glm::dvec3> rest_mm;
  const Motion& motion;
  std::size_t mode;

  std::vector<glm::dvec3> at(double phase) const {
    const HeldMotion held = motion.mode_held_at(mode, phase);
    std::vector<glm::dvec3> moved_mm = rest_mm;
    constexpr std::int64_t kTogether = 64;
    const std::int64_t count = std::ssize(rest_mm);
    parallel_for((count + kTogether - 1) / kTogether, [&](std::int64_t block) {
      for (std::int64_t i = kTogether * block; i < std::min(count, kTogether * (block + 1)); ++i)
        if (glm::dvec3& place_mm = moved_mm[static_cast<std::size_t>(i)];
            auto found_mm = undone(held, place_mm, place_mm))
          place_mm = *found_mm;
    });
    return moved_mm;
  }

  /// The largest difference to what the places at the keys make of a phase.
  double error_mm(const std::vector<std::pair<double, std::vector<glm::dvec3>>>& keys, bool wraps,
                  double phase, const std::vector<glm::dvec3>& exact_mm) const {
    std::vector<double> phases;
    for (const auto& [key, moved_mm] : keys) phases.push_back(key);
    const std::vector<double> weights = phase_weights(phases, wraps, phase);
    double largest_mm = 0;
    for (std::size_t i = 0; i < rest_mm.size(); ++i) {
      glm::dvec3 sum_mm(0);
      for (std::size_t k = 0; k < keys.size(); ++k) sum_mm += weights[k] * keys[k].second[i];
      largest_mm = std::max(largest_mm, glm::distance(sum_mm, exact_mm[i]));
    }
    return largest_mm;
  }
};

/// Finds a point's places at all keys.
class MovingPoints::Filler {
 public:
  Filler(MovingPoints& points, const Motion& motion) : points_(points) {
    std::size_t keys = 1;
    for (std::size_t m = 0; m < motion.modes().size(); ++m) {
      strides_.push_back(keys);
      keys *= points.key_phases_[m].size();
      std::vector<HeldMotion>& held = held_.emplace_back();
      for (const double phase : points.key_phases_[m]) held.push_back(motion.mode_held_at(m, phase));
    }
  }

  /// Whether it has a place everywhere.
  bool fill(std::size_t point) const { return fill(point, held_.size(), points_.rest_mm_[point], 0); }

 private:
  /// A place went through the first mode first, so that the last one is undone first. `key` is that of the
  /// modes that are undone, and the first of the others.
  bool fill(std::size_t point, std::size_t modes_left, const glm::dvec3& place_mm, std::size_t key) const {
    if (modes_left == 0) return store(point, place_mm, key);
    const std::size_t mode = modes_left - 1;
    glm::dvec3 guess_mm = place_mm;
    std::optional<std::size_t> still;  // a key at which this mode leaves the place alone
    bool is_found = true;
    for (std::size_t k = 0; k < held_[mode].size(); ++k) {
      const std::size_t here = key + k * strides_[mode];
      const std::optional<glm::dvec3> found_mm = undone(held_[mode][k], place_mm, guess_mm);
      guess_mm = found_mm.value_or(place_mm);
      is_found = is_found && found_mm;
      const bool is_still = guess_mm == place_mm;
      if (is_still && still) {
        copy(point, *still, here, strides_[mode]);
        continue;
      }
      is_found = fill(point, mode, guess_mm, here) && is_found;
      if (is_still) still = here;
    }
    return is_found;
  }

  std::int16_t* at(std::size_t point, std::size_t key) const {
    return points_.moved_.data() + key * points_.padded_size() + 3 * point;
  }

  bool store(std::size_t point, const glm::dvec3& place_mm, std::size_t key) const {
    const glm::dvec3 steps = (place_mm - glm::dvec3(points_.rest_mm_[point])) / points_.step_mm_;
    for (int axis = 0; axis < 3; ++axis)
      at(point, key)[axis] =
          static_cast<std::int16_t>(std::lrint(std::clamp(steps[axis], -kLargest, kLargest)));
    return glm::all(glm::lessThanEqual(glm::abs(steps), glm::dvec3(kLargest)));
  }

  void copy(std::size_t point, std::size_t from, std::size_t to, std::size_t keys) const {
    for (std::size_t k = 0; k < keys; ++k) std::copy_n(at(point, from + k), 3, at(point, to + k));
  }

  MovingPoints& points_;
  std::vector<std::size_t> strides_;           ///< of each mode, in keys
  std::vector<std::vector<HeldMotion>> held_;  ///< of each mode, at its keys
};

MovingPoints::MovingPoints(std::vector<glm::vec3> points_mm, const Motion& motion, Progress& progress,
                           double tolerance_mm)
    : rest_mm_(std::move(points_mm)) {
  const CancelScope scope(progress);
  choose_keys(motion, tolerance_mm);
  std::size_t keys = 1;
  for (const std::vector<double>& phases : key_phases_) keys *= phases.size();
  moved_.resize(keys * padded_size());
  const Filler filler(*this, motion);
  constexpr std::int64_t kTogether = 128;
  const std::int64_t count = std::ssize(rest_mm_), blocks = (count + kTogether - 1) / kTogether;
  progress.begin("moving", blocks, "parts");
  std::atomic<std::int64_t> lost = 0;
  parallel_for(blocks, [&](std::int64_t block) {
    for (std::int64_t i = kTogether * block; i < std::min(count, kTogether * (block + 1)); ++i)
      if (!filler.fill(static_cast<std::size_t>(i))) ++lost;
    progress.advance();
  });
  lost_ = lost;
}

std::size_t MovingPoints::padded_size() const { return (3 * size() + kBlock - 1) / kBlock * kBlock; }

/// Halves intervals until the sample is right in the middle of each. Also finds the numbers' step: so that
/// twice the sample's longest way can be held, and all ways up to some.
void MovingPoints::choose_keys(const Motion& motion, double tolerance_mm) {
  constexpr std::size_t kMostSamples = 1000;
  constexpr double kLeastReach_mm = 30;
  double reach_mm = 0;
  Sample sample{{}, motion, 0};
  for (std::size_t i = 0; i < size(); i += (size() + kMostSamples - 1) / kMostSamples)
    sample.rest_mm.emplace_back(rest_mm_[i]);
  for (; sample.mode < motion.modes().size(); ++sample.mode) {
    const MotionMode& mode = motion.modes()[sample.mode];
    const bool wraps = mode.wraps();
    std::vector<std::pair<double, std::vector<glm::dvec3>>> keys;
    for (const double phase : phases_of(mode)) keys.emplace_back(phase, sample.at(phase));
    for (bool is_fine = false; !is_fine && keys.size() < kMostKeys;) {
      is_fine = true;
      const std::size_t intervals = wraps ? keys.size() : keys.size() - 1;
      std::vector<std::pair<double, std::vector<glm::dvec3>>> more;
      for (std::size_t k = 0; k < intervals; ++k) {
        const double end = k + 1 < keys.size() ? keys[k + 1].first : keys.front().first + 1;
        const double middle = 0.5 * (keys[k].first + end), phase = middle - std::floor(middle);
        std::vector<glm::dvec3> exact_mm = sample.at(phase);
        if (sample.error_mm(keys, wraps, phase, exact_mm) <= tolerance_mm) continue;
        more.emplace_back(phase, std::move(exact_mm));
        is_fine = false;
      }
      std::ranges::move(more, std::back_inserter(keys));
      std::ranges::sort(keys, {}, &std::pair<double, std::vector<glm::dvec3>>::first);
    }
    wraps_.push_back(wraps);
    std::vector<double>& phases = key_phases_.emplace_back();
    for (const auto& [phase, moved_mm] : keys) {
      phases.push_back(phase);
      for (std::size_t i = 0; i < moved_mm.size(); ++i)
        reach_mm = std::max(reach_mm, glm::distance(moved_mm[i], sample.rest_mm[i]));
    }
  }
  step_mm_ = (kLeastReach_mm + 2 * reach_mm * static_cast<double>(key_phases_.size())) / kLargest;
}

void MovingPoints::at(std::span<const double> phases, std::span<glm::vec3> moved_mm) const {
  if (rest_mm_.empty()) return;
  struct Term {
    float weight;
    const std::int16_t* moved;
  };
  // One term for each combination of keys that count, the last mode's first.
  std::vector<Term> terms{{static_cast<float>(step_mm_), moved_.data()}};
  std::size_t stride = padded_size();
  for (std::size_t m = 0; m < key_phases_.size(); ++m) {
    const std::vector<double> weights = phase_weights(key_phases_[m], wraps_[m], phases[m]);
    std::vector<Term> with_mode;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      constexpr double kNothing = 1e-6;
      if (std::abs(weights[k]) < kNothing) continue;
      for (const Term& term : terms)
        with_mode.push_back({term.weight * static_cast<float>(weights[k]), term.moved + k * stride});
    }
    terms = std::move(with_mode);
    stride *= key_phases_[m].size();
  }

  std::array<float, kBlock> sum;
  const float* const rest = &rest_mm_.front().x;
  float* const out = &moved_mm.front().x;
  const std::size_t numbers = 3 * size();
  for (std::size_t first = 0; first < numbers; first += kBlock) {
    sum.fill(0);
    for (const Term& term : terms) {
      const std::int16_t* const moved = term.moved + first;
      const float weight = term.weight;
      for (std::size_t i = 0; i < kBlock; ++i) sum[i] += weight * static_cast<float>(moved[i]);
    }
    for (std::size_t i = 0; i < std::min(kBlock, numbers - first); ++i)
      out[first + i] = rest[first + i] + sum[i];
  }
}

std::vector<glm::vec3> MovingPoints::at(std::span<const double> phases) const {
  std::vector<glm::vec3> moved_mm(size());
  at(phases, moved_mm);
  return moved_mm;
}

}  // namespace xraycast
