#pragma once

#include "options/run_options.hpp"
#include "xraycast/simulation/exercise.hpp"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <optional>
#include <string>

namespace xraycast::cli {

/// --exercise, where one applies. Its instruments and its script make up for those of --device-model and
/// --script that are not given, which `command` has by add_coaxial_options and add_script_option.
void add_exercise_option(CLI::App& command, std::string& exercise, const std::string& purpose);

/// --report: a file of the run's figures.
void add_report_option(CLI::App& command, std::string& report, const std::string& purpose);

/// Throws InputError where --report cannot be written; nothing of an empty name.
void check_report_option(const std::string& report);

/// The exercise of a file in the tree of `vessels`, whose instruments `run` has where none are given; none of
/// an empty name. Throws InputError as read_exercise does.
std::optional<Exercise> parse_exercise_option(const CLI::App& command, const std::string& file,
                                              const std::filesystem::path& vessels, RunOptions& run);

/// The exercise's reference run where no script is given. Throws InputError where it has none.
void take_reference(const Exercise& exercise, const std::string& file, RunOptions& run);

/// The exercise's entry where none is given. Throws InputError for instruments that it does not allow.
void apply(const Exercise& exercise, const RunOptions& run, RunRequest& request);

}  // namespace xraycast::cli
