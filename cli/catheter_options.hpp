#pragma once

#include <CLI/CLI.hpp>

#include <string>

namespace xraycast::cli {

/// --device-model and --entry: what is steered, and where it comes in. The first is required unless
/// `instrument_model` has a default.
void add_catheter_options(CLI::App& command, std::string& instrument_model, std::string& entry);

}  // namespace xraycast::cli
