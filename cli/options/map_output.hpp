#pragma once

#include "options/command.hpp"
#include "xraycast/casting/body_map.hpp"

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

namespace xraycast::cli {

/// Where `cast` and `recast` put a body map and its picture.
struct MapOutput {
  std::string map, preview, window = "auto";
  std::optional<std::string> precision;
};

/// --output, --preview, --preview-window and --precision.
void add_map_output_options(CLI::App& command, MapOutput& output);

/// Throws InputError for a precision other than bytes of a map that moves.
void check_precision(const MapOutput& output, bool moves);

/// Gives the map the precision that is asked for. Throws as check_precision.
void choose_precision(BodyMap& map, const MapOutput& output);

/// Adds the keys of a map that moves to what is printed.
void report_keys(const BodyMap& map, Json& json, std::string& text);

/// Writes the map, and the preview if requested.
void write_map(const BodyMap& map, const MapOutput& output);

/// A map's geometry and precision.
Json to_json(const BodyMap& map);

/// Adds the preview, if there is one, to what is printed.
void report_preview(const MapGeometry& geometry, const MapOutput& output, Json& json, std::string& text);

}  // namespace xraycast::cli
