#include "xraycast/simulation/exercise_progress.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

std::optional<double> depth_of(const VesselDepth& vessel, const InstrumentTip& tip) {
  return vessel.of_mm(tip.branch, tip.arc_length_mm);
}

/// Not where it is between both, so that a tip that trembles enters once.
bool has_left(const VesselDepth& vessel, const InstrumentTip& tip) {
  if (const std::optional<double> depth_mm = depth_of(vessel, tip)) return *depth_mm <= 0;
  const std::optional<double> beyond_mm = vessel.beyond_mm(tip.branch, tip.arc_length_mm);
  return !beyond_mm || *beyond_mm >= ExerciseProgress::kEntered_mm;
}

}  // namespace

std::size_t ExerciseState::reached() const {
  const auto is_reached = [](const Target& target) { return target.reached_s.has_value(); };
  return static_cast<std::size_t>(std::count_if(targets.begin(), targets.end(), is_reached));
}

bool ExerciseState::is_passed() const {
  const auto is_kept = [](const Limit& limit) { return !limit.passed_s; };
  return is_complete() && forbidden_entries.empty() && std::all_of(limits.begin(), limits.end(), is_kept);
}

ExerciseProgress::ExerciseProgress(Exercise exercise, const VesselTree& tree)
    : exercise_(std::move(exercise)) {
  for (const ExerciseTarget& target : exercise_.targets) {
    target_depths_.emplace_back(tree, target.branches);
    came_deeper_.emplace_back(Instruments::kMaxCount);
    state_.targets.push_back({.name = target.name});
  }
  for (const ForbiddenVessel& vessel : exercise_.forbidden) {
    forbidden_depths_.emplace_back(tree, vessel.branches);
    is_in_.emplace_back(Instruments::kMaxCount, false);
  }
  for (const ExerciseLimit& of : kExerciseLimits)
    if (const std::optional<double>& limit = exercise_.limits.*of.value) {
      state_.limits.push_back({.name = of.name, .limit = *limit});
      limited_.push_back(of.value);
    }
}

std::optional<ExerciseProgress> progress_of(const std::optional<Exercise>& exercise, const VesselTree& tree) {
  if (!exercise) return std::nullopt;
  return ExerciseProgress(*exercise, tree);
}

void ExerciseProgress::add(const Instruments& instruments, const RunReport& report) {
  if (state_.is_complete()) return;
  const double time_s = report.figures().time_s;
  add_entries(instruments, time_s);
  add_limits(instruments, report);
  look_where_tips_came_from(instruments);
  for (std::size_t next = state_.reached(); next < state_.targets.size() && is_reached(next, instruments);
       ++next)
    state_.targets[next].reached_s = time_s;
}

void ExerciseProgress::look_where_tips_came_from(const Instruments& instruments) {
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    const InstrumentTip tip = instruments.tip(d);
    for (std::size_t t = 0; t < exercise_.targets.size(); ++t) {
      std::optional<bool>& came_deeper = came_deeper_[t][d];
      const std::optional<double> depth_mm = depth_of(target_depths_[t], tip);
      if (!depth_mm)
        came_deeper.reset();
      else if (!came_deeper)
        came_deeper = *depth_mm > exercise_.targets[t].depth_mm;
    }
  }
}

bool ExerciseProgress::is_reached(std::size_t target, const Instruments& instruments) const {
  const ExerciseTarget& wanted = exercise_.targets[target];
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    if (wanted.instrument && *wanted.instrument != d) continue;
    const InstrumentTip tip = instruments.tip(d);
    if (wanted.branches.empty()) {
      if (glm::distance(tip.scan_mm, wanted.at_mm) <= wanted.radius_mm) return true;
    } else if (const std::optional<bool> came_deeper = came_deeper_[target][d]) {
      const std::optional<double> depth_mm = depth_of(target_depths_[target], tip);
      if (*came_deeper ? depth_mm <= wanted.depth_mm : depth_mm >= wanted.depth_mm) return true;
    }
  }
  return false;
}

void ExerciseProgress::add_entries(const Instruments& instruments, double time_s) {
  for (std::size_t v = 0; v < forbidden_depths_.size(); ++v)
    for (std::size_t d = 0; d < instruments.count(); ++d) {
      const InstrumentTip tip = instruments.tip(d);
      if (!is_in_[v][d] && depth_of(forbidden_depths_[v], tip) >= kEntered_mm) {
        is_in_[v][d] = true;
        state_.forbidden_entries.push_back({exercise_.forbidden[v].name, d, time_s});
      } else if (has_left(forbidden_depths_[v], tip)) {
        is_in_[v][d] = false;
      }
    }
}

void ExerciseProgress::add_limits(const Instruments& instruments, const RunReport& report) {
  const RunFigures& figures = report.figures();
  double force_N = 0;
  for (std::size_t d = 0; d < instruments.count(); ++d)
    force_N = std::max(force_N, std::abs(instruments.load(d).force_N));
  const ExerciseLimits now{.time_s = figures.time_s,
                           .fluoroscopy_s = figures.use.fluoroscopy_s,
                           .air_kerma_mGy = figures.use.air_kerma_mGy,
                           .dap_Gycm2 = figures.use.dap_Gycm2,
                           .contrast_ml = figures.use.contrast_ml,
                           .force_N = force_N,
                           .wall_force_N = report.wall_N()};
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    ExerciseState::Limit& limit = state_.limits[i];
    limit.value = std::max(limit.value, now.*limited_[i]);  // nothing is less than any
    if (!limit.passed_s && limit.value > limit.limit) limit.passed_s = figures.time_s;
  }
}

}  // namespace xraycast
