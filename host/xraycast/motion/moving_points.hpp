#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/motion/motion.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// Places of a body in motion, such as the corners of its vessels' surface, at any phases within a
/// millisecond or two: HeldMotion::inverse_mm finds them at a grid of key phases ahead, and they are
/// interpolated by Catmull-Rom splines, one mode after the other. The keys are those of the motion, and more
/// between them until a sample of the places, in the middle of each interval, is right within the tolerance;
/// modes add up.
///
/// 6 bytes a place and key. Thread-safe once it is made.
class MovingPoints {
 public:
  static constexpr double kTolerance_mm = 0.05;

  /// Places in the scan, mm, LPS. Stage "moving" of `progress`, on all cores.
  MovingPoints(std::vector<glm::vec3> points_mm, const Motion& motion, Progress& progress,
               double tolerance_mm = kTolerance_mm);

  std::size_t size() const { return rest_mm_.size(); }

  /// Where they are while each mode is at a phase, 0 to 1, in the motion's order: one for one.
  void at(std::span<const double> phases, std::span<glm::vec3> moved_mm) const;
  std::vector<glm::vec3> at(std::span<const double> phases) const;

  /// How many have no place at some key, because the motion folds; that mode leaves them there.
  std::int64_t lost() const { return lost_; }

  /// Of each mode, ascending.
  const std::vector<std::vector<double>>& key_phases() const { return key_phases_; }
  std::size_t memory_B() const { return moved_.size() * sizeof(std::int16_t); }

 private:
  struct Sample;  // of the places
  class Filler;
  std::size_t padded_size() const;
  void choose_keys(const Motion& motion, double tolerance_mm);

  std::vector<glm::vec3> rest_mm_;
  std::vector<bool> wraps_;                      ///< of each mode
  std::vector<std::vector<double>> key_phases_;  ///< of each mode
  double step_mm_ = 0;                           ///< of the numbers below
  std::vector<std::int16_t> moved_;              ///< from rest, by keys, the first mode's fastest
  std::int64_t lost_ = 0;
};

}  // namespace xraycast
