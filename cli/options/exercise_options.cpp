#include "options/exercise_options.hpp"

#include "options/command.hpp"
#include "xraycast/base/error.hpp"

namespace xraycast::cli {

void add_exercise_option(CLI::App& command, std::string& exercise) {
  const auto make_up = [&command](const std::string&) {
    for (const char* option : {"--device-model", "--script"}) command.get_option(option)->required(false);
  };
  command
      .add_option(
          "--exercise", exercise,
          "A task whose progress is counted (docs/exercises.md). Its instruments, entry and reference "
          "run are those of --device-model, --entry and --script where these are not given")
      ->each(make_up)
      ->type_name("JSON");
}

std::optional<Exercise> parse_exercise_option(const std::string& file, const std::filesystem::path& vessels,
                                              RunOptions& run) {
  if (file.empty()) return std::nullopt;
  Exercise exercise = read_exercise(file, read_tree(vessels));
  if (run.instrument_models.empty()) run.instrument_models = exercise.instruments;
  if (run.script.empty()) run.script = exercise.reference;
  if (run.script.empty())
    throw InputError("--exercise {}: has no reference run; give a run by --script", file);
  return exercise;
}

void apply(const Exercise& exercise, const RunOptions& run, RunRequest& request) {
  if (run.entry.empty()) request.entry = exercise.entry;
  for_option("--device-model", [&] {
    check_allowed(exercise, request.instruments);
    return 0;
  });
}

}  // namespace xraycast::cli
