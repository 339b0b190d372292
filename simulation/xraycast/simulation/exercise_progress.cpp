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
    state_.targets.push_back({.name = target.name});
  }
  for (const ForbiddenVessel& vessel : exercise_.forbidden) {
    forbidden_depths_.emplace_back(tree, vessel.branches);
    is_in_.emplace_back(Instruments::kMaxCount, false);
  }
  const ExerciseLimits& limits = exercise_.limits;
  const auto add = [&](const char* name, const std::optional<double>& limit) {
    if (limit) state_.limits.push_back({.name = name, .limit = *limit});
  };
  add("time_s", limits.time_s);
  add("fluoroscopy_s", limits.fluoroscopy_s);
  add("air_kerma_mGy", limits.air_kerma_mGy);
  add("dap_Gycm2", limits.dap_Gycm2);
  add("contrast_ml", limits.contrast_ml);
  add("force_N", limits.force_N);
  add("wall_force_N", limits.wall_force_N);
}

void ExerciseProgress::add(const Instruments& instruments, const RunReport& report) {
  if (state_.is_complete()) return;
  const double time_s = report.figures().time_s;
  add_entries(instruments, time_s);
  add_limits(instruments, report);
  for (std::size_t next = state_.reached(); next < state_.targets.size() && is_reached(next, instruments);
       ++next)
    state_.targets[next].reached_s = time_s;
}

bool ExerciseProgress::is_reached(std::size_t target, const Instruments& instruments) const {
  const ExerciseTarget& wanted = exercise_.targets[target];
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    if (wanted.instrument && *wanted.instrument != d) continue;
    const InstrumentTip tip = instruments.tip(d);
    if (wanted.branches.empty() ? glm::distance(tip.scan_mm, wanted.at_mm) <= wanted.radius_mm
                                : depth_of(target_depths_[target], tip) >= wanted.depth_mm)
      return true;
  }
  return false;
}

void ExerciseProgress::add_entries(const Instruments& instruments, double time_s) {
  for (std::size_t v = 0; v < forbidden_depths_.size(); ++v)
    for (std::size_t d = 0; d < instruments.count(); ++d) {
      const std::optional<double> depth_mm = depth_of(forbidden_depths_[v], instruments.tip(d));
      if (!is_in_[v][d] && depth_mm >= kEntered_mm) {
        is_in_[v][d] = true;
        state_.forbidden_entries.push_back({exercise_.forbidden[v].name, d, time_s});
      } else if (!(depth_mm > 0.0)) {
        is_in_[v][d] = false;
      }
    }
}

void ExerciseProgress::add_limits(const Instruments& instruments, const RunReport& report) {
  const RunFigures& figures = report.figures();
  double force_N = 0;
  for (std::size_t d = 0; d < instruments.count(); ++d)
    force_N = std::max(force_N, std::abs(instruments.load(d).force_N));
  const auto value_of = [&](const std::string& name) -> std::optional<double> {
    if (name == "time_s") return figures.time_s;
    if (name == "fluoroscopy_s") return figures.use.fluoroscopy_s;
    if (name == "air_kerma_mGy") return figures.use.air_kerma_mGy;
    if (name == "dap_Gycm2") return figures.use.dap_Gycm2;
    if (name == "contrast_ml") return figures.use.contrast_ml;
    return name == "force_N" ? force_N : report.wall_N();
  };
  for (ExerciseState::Limit& limit : state_.limits) {
    limit.value = std::max(limit.value, value_of(limit.name));  // nothing is less than any
    if (!limit.passed_s && limit.value > limit.limit) limit.passed_s = figures.time_s;
  }
}

}  // namespace xraycast
