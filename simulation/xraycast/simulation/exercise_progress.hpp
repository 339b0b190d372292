#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/exercise.hpp"
#include "xraycast/simulation/run_report.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// How far an exercise is. Times are those of RunFigures::time_s.
struct ExerciseState {
  struct Target {
    std::string name;
    std::optional<double> reached_s{};
  };
  struct Entry {
    std::string name;  ///< of the forbidden vessel
    std::size_t instrument = 0;
    double time_s = 0;
  };
  struct Limit {
    std::string name;  ///< as its field in the exercise's file
    double limit = 0;
    std::optional<double> value{};  ///< the largest so far; none: it is not counted
    std::optional<double> passed_s{};
  };
  std::vector<Target> targets;
  std::vector<Entry> forbidden_entries;
  std::vector<Limit> limits;  ///< those that the exercise has

  std::size_t reached() const;  ///< targets
  bool is_complete() const { return reached() == targets.size(); }
  /// Complete, without forbidden entries, and within the limits.
  bool is_passed() const;
};

/// Follows an exercise as a run goes on. Once its last target is reached nothing more is counted.
class ExerciseProgress {
 public:
  /// A tip has entered a forbidden vessel when it is so deep in it (see VesselDepth), and left it when it is
  /// no longer beyond its origin, or so far in a vessel that leaves it.
  static constexpr double kEntered_mm = 5;

  ExerciseProgress(Exercise exercise, const VesselTree& tree);

  /// After each step, which `report` counted before, with what was used by then.
  void add(const Instruments& instruments, const RunReport& report);

  const Exercise& exercise() const { return exercise_; }
  const ExerciseState& state() const { return state_; }

 private:
  bool is_reached(std::size_t target, const Instruments& instruments) const;
  void look_where_tips_came_from(const Instruments& instruments);
  void add_entries(const Instruments& instruments, double time_s);
  void add_limits(const Instruments& instruments, const RunReport& report);

  Exercise exercise_;
  std::vector<VesselDepth> target_depths_, forbidden_depths_;
  /// Of each target, each instrument: whether its tip came into the vessel deeper than the target; none where
  /// it is not in it.
  std::vector<std::vector<std::optional<bool>>> came_deeper_;
  std::vector<std::vector<bool>> is_in_;  ///< of each forbidden vessel, each instrument
  std::vector<std::optional<double> ExerciseLimits::*> limited_;  ///< of the state's limits
  ExerciseState state_;
};

/// Of an exercise as it begins; none where there is none.
std::optional<ExerciseProgress> progress_of(const std::optional<Exercise>& exercise, const VesselTree& tree);

}  // namespace xraycast
