#include "options/catheter_options.hpp"
#include "options/command.hpp"
#include "options/scene_options.hpp"
#include "options/session_map.hpp"
#include "options/web_session.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/export/gltf_file.hpp"
#include "xraycast/export/web_page.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/vessels.hpp"
#include "xraycast/simulation/run_script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct ExportArguments {
  std::string map, output, session, script, entry, title, precision = "byte";
  std::vector<std::string> instrument_models{"cobra-5f"};
  SceneOptions scene;
  const CLI::App* command = nullptr;
};

bool is_gltf(const std::string& output) { return has_extension(output, ".glb"); }

void check_output(const ExportArguments& options) {
  if (!is_gltf(options.output) && !has_extension(options.output, ".html"))
    throw InputError("{}: must end in .html, for a page, or in .glb, for a glTF scene", options.output);
  check_writable(options.output);
}

/// Rejects options that have no effect.
void check_applies(const ExportArguments& options) {
  if (is_gltf(options.output))
    check_not_given(*options.command, {"--precision"},
                    fmt::format("to {}, which holds no map; leave it out or write a .html", options.output));
  if (options.script.empty())
    check_not_given(*options.command, {"--device-model", "--entry"},
                    "without a run; leave it out or give --script too");
}

ViewSession resolve_session(const ExportArguments& options) {
  ViewSession scene = resolve_scene(options.session, options.map, options.scene);
  if (!options.script.empty() && scene.vessels.empty())
    throw InputError("--script {}: there are no vessels to steer in; give --vessels too", options.script);
  return scene;
}

/// A catheter of control points, meshed once their number is known to be sensible.
Surface checked_catheter(const fs::path& path) {
  constexpr std::ptrdiff_t kMostPoints = 5000;  // nearly kMostWebTriangles
  const std::string text = read_whole_file(path);
  if (std::ranges::count(text, '\n') > kMostPoints)
    throw InputError(
        "{}: more than {} lines, but an export holds a catheter of at most {} control points; "
        "give fewer",
        path.string(), kMostPoints, kMostPoints);
  return read_catheter(path);
}

/// The run of --script, simulated again, from the script's first pose on.
RecordedRun simulated_run(const ExportArguments& options, const fs::path& vessels, Session& session) {
  const EntryChoice entry_choice = parse_entry(options.entry);
  std::vector<InstrumentModel> devices;
  for (const std::string& name : options.instrument_models) devices.push_back(InstrumentModel::named(name));
  check_instruments(devices);
  const Script script = Script::read(options.script, devices.size());
  if (const double end_s = script.rows().back().time_s; end_s > RecordedRun::kLongest_s)
    throw InputError("{}: lasts {:g} s, but an export holds a run of at most {:g} s; shorten it",
                     options.script, end_s, RecordedRun::kLongest_s);
  const VesselTree tree = read_tree(vessels);
  const VesselEnd entry = find_entry(tree, entry_choice, devices[0]);
  Instruments steered(tree, devices, entry);
  session.say(notes_on_entry(tree, entry_choice, entry, devices[0]));
  RecordedRun run = RecordedRun::of(devices);
  run_script(steered, script, options.script, session.progress,
             [&](const Instruments& moved, double time_s) { run.see(moved, time_s); });
  if (run.pictures() == 0) run.see(steered, 0);  // a script of one pose
  return run;
}

WebSession gather(const ExportArguments& options, Session& session) {
  const ViewSession scene = resolve_session(options);
  WebSession web;
  web.map = load_map(scene, session);
  if (!is_gltf(options.output)) check_web_map(*web.map, scene.map.string());
  const BodyBounds bounds = bounds_of(web.map->geometry);
  if (!scene.vessels.empty()) {
    web.vessels = read_vessels(scene.vessels, scene.contrast_mg_ml);
    check_web_surface(*web.vessels, bounds, scene.vessels.string());
  }
  if (!options.script.empty()) web.run = simulated_run(options, scene.vessels, session);
  if (scene.steered && !web.run)
    web.catheters = steered_surfaces(*scene.steered);
  else if (!scene.catheter.empty())
    web.catheters = {checked_catheter(scene.catheter)};
  web.shows_vessels = !scene.steered;
  web.shows_road_map = scene.steered && scene.steered->has_road_map;
  web.title = options.title.empty() ? "Fluoroscopy" : options.title;  // a file's name may be the patient's
  web.precision = parse_map_precision(options.precision);
  web.pose = scene.pose;
  web.is_of_session = !options.session.empty();
  web.style = scene.style;
  web.has_window = scene.has_window;
  if (!is_gltf(options.output) && scene.style.sampling != SampleOptions{})
    session.say(
        {"a page adds up shells by the path in each, reconstructed linearly; the session's walls or constant "
         "shells are not exported"});
  return web;
}

void export_session(const ExportArguments& options, Session& session) {
  check_output(options);
  check_applies(options);
  WebSession web = gather(options, session);
  std::string bytes;
  if (is_gltf(options.output)) {
    bytes = gltf_binary(web);
  } else {
    web.still_png = still_png(web);
    bytes = web_page(web);
  }
  write_whole_file(options.output, bytes);
  const std::size_t pictures = web.run ? web.run->pictures() : 0;
  session.report({{"file", options.output}, {"bytes", bytes.size()}, {"pictures", pictures}},
                 fmt::format("{}: {:.1f} MB{}\n", options.output, static_cast<double>(bytes.size()) / 1e6,
                             pictures > 1 ? ", with a run of " + pluralize(pictures, "picture") : ""));
}

}  // namespace

void add_export(CLI::App& app, Session& session) {
  const auto options = std::make_shared<ExportArguments>();
  CLI::App* command = add_command(
      app, session, "export", "Write a session as one web page, or as a glTF scene",
      "  xraycast export map.exr -o page.html\n"
      "  xraycast export map.exr --vessels thorax-truth -o page.html --precision half\n"
      "  xraycast export map.exr --vessels vessels --script push.csv --device-model cobra-5f -o run.html\n"
      "  xraycast export map.exr --vessels vessels --script pair.csv --device-model cobra-5f \\\n"
      "    --device-model guidewire-035-j -o run.html\n"
      "  xraycast export map.exr --vessels vessels --script push.csv -o run.glb\n"
      "  xraycast export --session operation.json -o page.html",
      [options, &session] { export_session(*options, session); });
  options->command = command;
  command->add_option("MAP", options->map, "The body map (see `xraycast cast`)")->type_name("MAP.exr");
  command
      ->add_option("-o,--output", options->output,
                   ".html: a page that any browser opens, off line; .glb: vessels, catheter, axis and C-arm, "
                   "without the map")
      ->required()
      ->type_name("FILE");
  add_scene_options(*command, options->scene);
  command
      ->add_option("--script", options->script,
                   "A run to simulate again in --vessels (see `xraycast simulate`)")
      ->type_name("CSV");
  add_coaxial_options(*command, options->instrument_models, options->entry);
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
