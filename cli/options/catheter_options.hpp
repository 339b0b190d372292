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

/// `branch 3 at (-89.0, -54.0, -357.0) mm, on the patient's right`.
std::string text_of(const VesselTree& tree, const VesselEnd& end);

/// A note where the entry is not chosen and other ends lie about as low as the one found; or none.
std::vector<std::string> notes_on_entry(const VesselTree& tree, const EntryChoice& choice,
                                        const VesselEnd& entry, const InstrumentModel& instrument);

}  // namespace xraycast::cli
