#include "options/command.hpp"
#include "options/run_options.hpp"
#include "options/scene_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/drawing/still_picture.hpp"
#include "xraycast/scene/session_map.hpp"

#include <fmt/format.h>

#include <memory>

namespace xraycast::cli {
namespace {

struct ExportArguments {
  std::string map, output, session, title, precision = "byte";
  RunOptions run{.instrument_models = {"cobra-5f"}};
  SceneOptions scene;
  const CLI::App* command = nullptr;
};

/// Rejects options that have no effect.
void check_applies(const ExportArguments& options, ExportFormat format) {
  if (format == ExportFormat::gltf)
    check_not_given(*options.command, {"--precision"},
                    fmt::format("to {}, which holds no map; leave it out or write a .html", options.output));
  if (options.run.script.empty())
    check_not_given(*options.command, {"--device-model", "--entry"},
                    "without a run; leave it out or give --script too");
}

void export_session(const ExportArguments& options, Invocation& invocation) {
  const ExportFormat format = export_format(options.output);
  check_writable(options.output);
  check_applies(options, format);
  ViewSession scene = resolve_scene(options.session, options.map, options.scene);
  const std::string& script = options.run.script;
  if (!script.empty()) {
    if (scene.vessels.empty())
      throw InputError("--script {}: there are no vessels to steer in; give --vessels too", script);
    scene.steered.reset();  // the run's instruments are shown instead
  }
  ExportRequest request = exported_session(scene, load_map(scene, invocation.device));
  request.format = format;
  if (!options.title.empty()) request.title = options.title;
  request.precision = parse_map_precision(options.precision);
  request.is_of_session = !options.session.empty();
  invocation.say(check(request));
  if (!script.empty()) {
    const RunRequest run = parse_run(options.run, scene.vessels);
    invocation.say(check(run));
    request.run = recorded_run(run, invocation.progress);
  }
  if (format == ExportFormat::page) request.still_png = still_png(request);
  const std::string bytes = export_bytes(request);
  write_whole_file(options.output, bytes);
  const std::size_t pictures = request.run ? request.run->pictures() : 0;
  invocation.report({{"file", options.output}, {"bytes", bytes.size()}, {"pictures", pictures}},
                    fmt::format("{}: {:.1f} MB{}\n", options.output, static_cast<double>(bytes.size()) / 1e6,
                                pictures > 1 ? ", with a run of " + pluralize(pictures, "picture") : ""));
}

}  // namespace

void add_export(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<ExportArguments>();
  CLI::App* command = add_command(
      app, invocation, "export", "Write a session as one web page, or as a glTF scene",
      "  xraycast export map.exr -o page.html\n"
      "  xraycast export map.exr --vessels thorax-truth -o page.html --precision half\n"
      "  xraycast export map.exr --vessels vessels --script push.csv --device-model cobra-5f -o run.html\n"
      "  xraycast export map.exr --vessels vessels --script pair.csv --device-model cobra-5f \\\n"
      "    --device-model guidewire-035-j -o run.html\n"
      "  xraycast export map.exr --vessels vessels --script push.csv -o run.glb\n"
      "  xraycast export --session operation.json -o page.html",
      [options, &invocation] { export_session(*options, invocation); });
  options->command = command;
  command->add_option("MAP", options->map, "The body map (see `xraycast cast`)")->type_name("MAP.exr");
  command
      ->add_option("-o,--output", options->output,
                   ".html: a page that any browser opens, off line; .glb: vessels, catheter, axis and C-arm, "
                   "without the map")
      ->required()
      ->type_name("FILE");
  add_scene_options(*command, options->scene);
  add_script_option(*command, options->run, "A run to simulate again in --vessels (see `xraycast simulate`)");
  add_coaxial_options(*command, options->run);
  command
      ->add_option("--precision", options->precision,
                   "How the page stores the map: byte (8 bits a texel) or half (16 bits)")
      ->check(CLI::IsMember({"byte", "half"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--title", options->title, "The page's title (default: Fluoroscopy)")
      ->type_name("TEXT");
  command->add_option("--session", options->session, "A session saved with Ctrl+S; other options override it")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
