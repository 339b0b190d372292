#include "xraycast/casting/recast.hpp"

#include "options/command.hpp"
#include "options/map_output.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/basis_file.hpp"

#include <fmt/format.h>

#include <memory>

namespace xraycast::cli {
namespace {

struct RecastArguments {
  std::string basis, opacity;
  MapOutput output;
};

void recast_map(const RecastArguments& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  if (options.opacity.starts_with("spectrum"))
    throw InputError("--opacity {}: beam hardening cannot be recast; use `xraycast cast`", options.opacity);
  const Opacity opacity = Opacity::named(options.opacity);
  check_writable(options.output.map);
  if (!options.output.preview.empty()) check_picture_name(options.output.preview, options.output.preview);
  ComputeDevice device(invocation.device);

  const Stopwatch reading;
  const Basis basis = read_basis(options.basis);
  const double read_ms = reading.ms();
  const Stopwatch uploading;
  RecastSession recasting(device, basis);
  const double upload_ms = uploading.ms();
  BodyMap map = recasting.recast(opacity);
  choose_precision(map, options.output);

  const Stopwatch writing;
  OutputSet outputs;
  write_map(map, options.output);
  outputs.commit();
  const double write_ms = writing.ms(), total_ms = stopwatch.ms();
  Json json{{"basis", {{"file", options.basis}, {"knots_hu", basis.knots_hu}}},
            {"map", to_json(map)},
            {"timings_ms",
             {{"read", read_ms},
              {"upload", upload_ms},
              {"kernel", recasting.kernel_ms()},
              {"write", write_ms},
              {"total", total_ms}}}};
  std::string text = fmt::format(
      "{}: {} of {} x {}, opacity {}\n"
      "read {:.0f} ms, upload {:.0f} ms, kernel {:.1f} ms, write {:.0f} ms, total {:.0f} ms\n",
      options.output.map, pluralize(map.geometry.layers(), "layer"), pluralize(map.geometry.width, "angle"),
      pluralize(map.geometry.height, "slice"), opacity.name(), read_ms, upload_ms, recasting.kernel_ms(),
      write_ms, total_ms);
  report_keys(map, json, text);
  report_preview(map.geometry, options.output, json, text);
  invocation.report(json, text);
}

}  // namespace

void add_recast(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<RecastArguments>();
  CLI::App* command = add_command(
      app, invocation, "recast", "Make a body map with another opacity from a basis, without the scan",
      "  xraycast cast scans/chest/ -o chest.exr --layers 8 --keep-basis chest.basis\n"
      "  xraycast recast chest.basis -o bone.exr --opacity bone.json --preview bone.png",
      [options, &invocation] { recast_map(*options, invocation); });
  command->add_option("BASIS", options->basis, "The basis that `xraycast cast --keep-basis` wrote")
      ->required();
  add_map_output_options(*command, options->output);
  command
      ->add_option(
          "--opacity", options->opacity,
          "paper, bilinear, subtracted, or a JSON file of HU and mu; each HU must be a knot of the basis")
      ->required()
      ->type_name("NAME|FILE");
}

}  // namespace xraycast::cli
