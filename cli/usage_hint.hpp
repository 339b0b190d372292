#pragma once

#include <CLI/CLI.hpp>

#include <string>

namespace xraycast::cli {

/// Advice on arguments that could not be parsed: the closest valid word, and which --help to read.
std::string usage_hint(const CLI::App& app);

}  // namespace xraycast::cli
