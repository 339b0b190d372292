#pragma once

#include "xraycast/mechanics/vessel_entry.hpp"

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace xraycast::cli {

/// --device-model and --entry: the instrument and its entry. The first is required unless `instrument_model`
/// has a default.
void add_catheter_options(CLI::App& command, std::string& instrument_model, std::string& entry);

/// The same with a --device-model that is required and repeats, the outermost device first.
void add_coaxial_options(CLI::App& command, std::vector<std::string>& instrument_models, std::string& entry);

/// Of --entry: a branch's number, or X,Y,Z in mm (LPS); empty for the default. Throws InputError.
EntryChoice parse_entry(const std::string& text);

}  // namespace xraycast::cli
