#pragma once

#include "options/run_options.hpp"
#include "xraycast/simulation/exercise.hpp"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <optional>
#include <string>

namespace xraycast::cli {

/// --exercise, where one applies. Its instruments and its script make up for those of `run` that are not
/// given, which `command` has by add_coaxial_options and add_script_option.
void add_exercise_option(CLI::App& command, std::string& exercise);

/// The exercise of a file in the tree of `vessels`, with what it has for `run`; none of an empty name.
/// Throws InputError as read_exercise does.
std::optional<Exercise> parse_exercise_option(const std::string& file, const std::filesystem::path& vessels,
                                              RunOptions& run);

/// The exercise's entry where none is given. Throws InputError for instruments that it does not allow.
void apply(const Exercise& exercise, const RunOptions& run, RunRequest& request);

}  // namespace xraycast::cli
