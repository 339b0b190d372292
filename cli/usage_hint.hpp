#pragma once

#include <CLI/CLI.hpp>

#include <string>

namespace xraycast::cli {

/// What to do about arguments that did not parse: the word that was meant, where one is close to what was
/// typed, and whose --help to read.
std::string usage_hint(const CLI::App& app);

}  // namespace xraycast::cli
