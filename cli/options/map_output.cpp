#include "options/map_output.hpp"

#include "options/motion_options.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/reports/map_preview.hpp"

#include <fmt/format.h>

namespace xraycast::cli {

void add_map_output_options(CLI::App& command, MapOutput& output) {
  command.add_option("-o,--output", output.map, "The body map, an OpenEXR file")
      ->required()
      ->type_name("MAP.exr");
  CLI::Option* preview =
      command
          .add_option("--preview", output.preview, "Also write a picture of the layers, the innermost first")
          ->type_name("IMAGE");
  command
      .add_option("--preview-window", output.window,
                  "auto: grey window from the map's values; paper: transmission exp(-tau), unscaled")
      ->check(CLI::IsMember({"auto", "paper"}))
      ->needs(preview)
      ->capture_default_str()
      ->type_name("auto|paper");
  command
      .add_option(
          "--precision", output.precision,
          "How values are stored, in the file and in texture memory: float (32 bits; default), half (16 "
          "bits) "
          "or byte (8 bits, scaled to the range of values of each layer; a map that moves is always so)")
      ->check(CLI::IsMember({"float", "half", "byte"}))
      ->type_name("NAME");
}

void check_precision(const MapOutput& output, bool moves) {
  if (moves && output.precision && parse_map_precision(*output.precision) != MapPrecision::byte)
    throw InputError("--precision {}: a map that moves is stored in bytes; leave it out", *output.precision);
}

void choose_precision(BodyMap& map, const MapOutput& output) {
  check_precision(output, map.keys != nullptr);
  map.precision = parse_map_precision(output.precision.value_or(map.keys ? "byte" : "float"));
}

void report_keys(const BodyMap& map, Json& json, std::string& text) {
  if (!map.keys) return;
  const KeyPhases& phases = map.keys->phases();
  json["keys"] = {{"maps", phases.count()}, {"bytes", map.keys->size_B()}, {"modes", to_json(phases)}};
  std::string modes;
  for (std::size_t m = 0; m < phases.phases().size(); ++m)
    modes += fmt::format("{}{} phases of {}", m > 0 ? " x " : "", phases.phases()[m].size(),
                         phases.rhythm().modes()[m].name);
  text += fmt::format("moves: {} ({}), {:.1f} MB\n", pluralize(phases.count(), "key map"), modes,
                      static_cast<double>(map.keys->size_B()) / 1e6);
}

void write_map(const BodyMap& map, const MapOutput& output) {
  if (!fits_precision(map))
    throw InputError("{}: the map's values exceed 16-bit floats; give --precision float or byte", output.map);
  write_body_map(map, output.map);
  if (!output.preview.empty())
    write_picture(map_preview(map, parse_preview_window(output.window)), output.preview);
}

void report_preview(const MapGeometry& geometry, const MapOutput& output, Json& json, std::string& text) {
  if (output.preview.empty()) return;
  json["preview"] = output.preview;
  text += fmt::format("{}: preview of {}\n", output.preview, pluralize(geometry.layers(), "layer"));
}

Json to_json(const BodyMap& map) {
  Json json = to_json(map.geometry);
  json["precision"] = to_string(map.precision);
  return json;
}

}  // namespace xraycast::cli
