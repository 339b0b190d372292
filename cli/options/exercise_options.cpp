#include "options/exercise_options.hpp"

#include "options/command.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/reports/run_comparison.hpp"

namespace xraycast::cli {

void add_exercise_option(CLI::App& command, std::string& exercise, const std::string& purpose) {
  const auto make_up = [&command](const std::string&) {
    for (const char* option : {"--device-model", "--script"}) command.get_option(option)->required(false);
  };
  command.add_option("--exercise", exercise, purpose)
      ->each(make_up)
      ->check([](const std::string& file) { return file.empty() ? "names no file" : ""; })
      ->type_name("JSON");
}

void add_report_option(CLI::App& command, std::string& report, const std::string& purpose) {
  command
      .add_option("--report", report,
                  purpose +
                      ", in figures (docs/exercises.md): as a page with plots, a table, or JSON, which "
                      "`xraycast report` takes")
      ->type_name("HTML|CSV|JSON");
}

void check_report_option(const std::string& report) {
  if (report.empty()) return;
  check_report_name(report, "--report " + report);
  check_writable(report);
}

std::optional<Exercise> parse_exercise_option(const CLI::App& command, const std::string& file,
                                              const std::filesystem::path& vessels, RunOptions& run) {
  if (file.empty()) return std::nullopt;
  Exercise exercise = read_exercise(file, read_tree(vessels));
  if (command.count("--device-model") == 0) run.instrument_models = exercise.instruments;
  return exercise;
}

void take_reference(const Exercise& exercise, const std::string& file, RunOptions& run) {
  if (run.script.empty()) run.script = exercise.reference;
  if (run.script.empty())
    throw InputError("--exercise {}: has no reference run; give a run by --script", file);
}

void apply(const Exercise& exercise, const RunOptions& run, RunRequest& request) {
  if (run.entry.empty()) request.entry = exercise.entry;
  for_option("--device-model", [&] {
    check_allowed(exercise, request.instruments);
    return 0;
  });
}

}  // namespace xraycast::cli
