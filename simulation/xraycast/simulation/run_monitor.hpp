#pragma once

#include "xraycast/simulation/exercise_progress.hpp"
#include "xraycast/simulation/run_report.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What is counted of a run while it goes on: its report and, where it has an exercise, how far that is.
class RunMonitor {
 public:
  /// Of instruments before their first step, with their names.
  RunMonitor(const Instruments& instruments, std::vector<std::string> names,
             std::optional<ExerciseProgress> progress = {});

  /// After each step, with what was used by then.
  void add(const Instruments& instruments, const RunUse& use = {});

  /// As RunReport::use.
  void use(const RunUse& use) { report_.use(use); }

  /// As RunReport::exchanged, by a model of this name.
  void exchanged(std::size_t instrument, const Instruments& instruments, const std::string& name);

  const RunReport& report() const { return report_; }
  const ExerciseProgress* progress() const { return progress_ ? &*progress_ : nullptr; }

  /// Figures, exercise, and with `has_series` how they went over time, as JSON (docs/exercises.md).
  std::string json(bool has_series) const;

 private:
  std::vector<std::string> names_;
  RunReport report_;
  std::optional<ExerciseProgress> progress_;
};

/// A line: `Left renal artery: passed; left renal artery after 7.8 s`, with what is missing or was passed.
std::string in_words(const ExerciseProgress& progress);

}  // namespace xraycast
