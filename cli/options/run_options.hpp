#pragma once

#include "options/motion_options.hpp"
#include "xraycast/simulation/run.hpp"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast::cli {

/// What runs and by what, as given.
struct RunOptions {
  std::vector<std::string> instrument_models{};
  std::string entry{}, script{};
  BodyOptions body{};
};

/// --device-model, which repeats, the outermost instrument first, and --entry: the instruments and their
/// entry. The first is required unless `options` has a default.
void add_coaxial_options(CLI::App& command, RunOptions& options);

/// --script
CLI::Option* add_script_option(CLI::App& command, RunOptions& options, const std::string& purpose);

/// The run in the tree of `vessels`, a file or a folder. --entry is a branch's number or name, or X,Y,Z in mm
/// (LPS); empty for the default. Throws InputError.
RunRequest parse_run(const RunOptions& options, const std::filesystem::path& vessels);

}  // namespace xraycast::cli
