#pragma once

#include "xraycast/catheter/vessel_entry.hpp"

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace xraycast::cli {

/// --device-model, which repeats, the outermost device first, and --entry: the instruments and their entry.
/// The first is required unless `instrument_models` has a default.
void add_coaxial_options(CLI::App& command, std::vector<std::string>& instrument_models, std::string& entry);

/// Of --entry: a branch's number, or X,Y,Z in mm (LPS); empty for the default. Throws InputError.
EntryChoice parse_entry(const std::string& text);

}  // namespace xraycast::cli
