#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A run's report as it was saved (docs/exercises.md).
struct SavedRun {
  /// Values over the run's time, of an instrument.
  using Curves = std::map<std::string, std::vector<double>>;

  std::string name;
  std::vector<std::string> instruments;                       ///< from the outermost on
  std::map<std::string, double> figures;                      ///< of the run, those that it has
  std::vector<std::map<std::string, double>> of_instruments;  ///< the same of each instrument
  /// What was done to vessels, in words, such as `balloon-6x20 in left renal artery`, and its figures.
  std::vector<std::string> treatments{};
  std::vector<std::map<std::string, double>> of_treatments{};
  std::string exercise{};  ///< its title; empty: none
  bool is_complete = false, is_passed = false;
  /// What became of a target, a forbidden vessel or a limit of the exercise.
  struct Outcome {
    std::string name;                ///< such as `target: left renal artery`
    std::string words;               ///< such as `7.8 s`
    std::optional<double> time_s{};  ///< when it was reached, entered or passed
    bool operator==(const Outcome&) const = default;
  };
  std::vector<Outcome> outcomes{};
  std::optional<double> complete_s{};  ///< when the last target was reached
  std::vector<double> time_s{};
  std::vector<Curves> curves{};      ///< of each instrument, as many values as times
  std::vector<std::string> notes{};  ///< what to know of it, in words
  std::string json{};                ///< as it was read, with its name

  /// Parses what RunMonitor::json and a page's "Save report" give. A name in the text goes before `name`.
  /// Throws InputError, with `origin` in front, for anything else.
  static SavedRun parse(const std::string& text, const std::string& name,
                        const std::string& origin = "report");
};

struct SavedRuns {
  std::vector<SavedRun> runs;
  std::optional<SavedRun> reference{};  ///< with which they are compared
};

/// A file of one run or of several, as write_runs writes it. Throws InputError.
SavedRuns read_runs(const std::filesystem::path& path);

/// Gives a run another name.
void rename(SavedRun& run, const std::string& name);

}  // namespace xraycast
