#include "options/command.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/motion_options.hpp"
#include "options/run_options.hpp"
#include "options/scene_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/drawing/still_picture.hpp"
#include "xraycast/scene/map_motion.hpp"
#include "xraycast/scene/session_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <memory>

namespace xraycast::cli {
namespace {

struct ExportArguments {
  std::string map, output, session, title, precision = "byte";
  RunOptions run{.instrument_models = {"cobra-5f"}};
  SceneOptions scene;
  std::vector<std::string> keys;
  bool is_live = false;
  std::string devices;
  std::vector<std::string> exercises;
  FluoroscopeRequest fluoroscope;
  const CLI::App* command = nullptr;
};

/// What else a page that steers takes.
constexpr std::initializer_list<const char*> kOfLive{"--devices",    "--exercise",    "--c-arm", "--dose",
                                                     "--pulse-rate", "--compression", "--seed"};

/// Rejects options that have no effect.
void check_applies(const ExportArguments& options, ExportFormat format) {
  if (format == ExportFormat::gltf) {
    check_not_given(*options.command, {"--precision", "--keys", "--gate", "--motion-speed"},
                    fmt::format("to {}, which holds no map; leave it out or write a .html", options.output));
    const std::string steers_nothing =
        fmt::format("to {}, which steers nothing; leave it out or write a .html", options.output);
    check_not_given(*options.command, {"--live"}, steers_nothing);
    check_not_given(*options.command, kOfLive, steers_nothing);
  }
  if (!options.is_live)
    check_not_given(*options.command, kOfLive, "without --live; leave it out or give --live too");
  if (options.run.script.empty() && !options.is_live)
    check_not_given(*options.command, {"--device-model", "--entry"},
                    "without a run; leave it out or give --script or --live too");
  else if (!options.is_live)
    check_not_given(*options.command, {"--gate"}, "to a run, whose time is the body's; leave it out");
}

/// How the body moves: by the motion that is given, else the one that the map names.
BodyRequest page_body(const ExportArguments& options, const BodyMap& map) {
  BodyRequest body = body_request_of(options.run.body);
  std::vector<std::string> notes;  // on the vessels; check() tells of those too
  if (!body.motion) body.motion = motion_of(map, {}, notes);
  return body;
}

/// The run in the body of the request. Of one that moves the motion must be there.
RunRequest run_request(const ExportArguments& options, const ExportRequest& request,
                       const ViewSession& scene) {
  RunOptions given = options.run;
  given.body = {};
  RunRequest run = parse_run(given, scene.vessels);
  if (!request.map->keys) return run;
  if (!request.body.motion)
    throw InputError("{}: moves, but {}, by which it was cast, is not there; give it by --motion",
                     request.map_name, request.map->keys->motion.string());
  run.body = request.body;
  return run;
}

/// `A,B`: presets or files.
std::vector<InstrumentModel> parse_devices(const std::string& list) {
  std::vector<std::string> names;
  for (std::size_t from = 0; !list.empty() && from <= list.size();) {
    const std::size_t end = std::min(list.find(',', from), list.size());
    names.push_back(list.substr(from, end - from));
    from = end + 1;
  }
  return for_option("--devices", [&] { return instruments_named(names); });
}

/// Those that are given, and all JSON files of folders, by their names.
std::vector<std::filesystem::path> exercise_files(const std::vector<std::string>& given) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::path path : given) {
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) {
      files.push_back(path);
      continue;
    }
    const auto first = static_cast<std::ptrdiff_t>(files.size());
    for (const auto& entry : std::filesystem::directory_iterator(path))
      if (has_extension(entry.path().string(), ".json")) files.push_back(entry.path());
    if (std::ssize(files) == first)
      throw InputError("--exercise {}: holds no JSON file; give an exercise", path.string());
    std::sort(files.begin() + first, files.end());
  }
  return files;
}

/// Notes are on entries: each exercise has its own.
void check_entries(RunRequest run, const std::vector<Exercise>& exercises, Invocation& invocation) {
  if (exercises.empty()) return invocation.say(check(run));
  check(run);
  for (const Exercise& exercise : exercises) {
    run.entry = exercise.entry;
    run.instruments = instruments_named(exercise.instruments);
    invocation.say(check(run));
  }
}

/// The page simulates by itself.
void add_trainer(const ExportArguments& options, const ViewSession& scene, ExportRequest& request,
                 Invocation& invocation) {
  RunOptions given = options.run;
  given.script.clear();
  given.body = {};
  const RunRequest run = parse_run(given, scene.vessels);
  std::vector<Exercise> exercises;
  for (const std::filesystem::path& file : exercise_files(options.exercises))
    exercises.push_back(read_exercise(file, *run.tree));
  check_entries(run, exercises, invocation);
  make_steered(request, run, parse_devices(options.devices), options.fluoroscope);
  add_exercises(request, exercises);
}

void export_session(const ExportArguments& options, Invocation& invocation) {
  const ExportFormat format = export_format(options.output);
  check_writable(options.output);
  check_applies(options, format);
  ViewSession scene = resolve_scene(options.session, options.map, options.scene);
  const std::string& script = options.run.script;
  if (!script.empty() && scene.vessels.empty())
    throw InputError("--script {}: there are no vessels to steer in; give --vessels too", script);
  if (options.is_live && scene.vessels.empty())
    throw InputError("--live: there are no vessels to steer in; give --vessels too");
  if (!script.empty() || options.is_live) scene.steered.reset();  // the run's instruments are shown instead
  std::shared_ptr<const BodyMap> map = load_map(scene, invocation.device);
  if (!options.keys.empty() && !map->keys)
    throw InputError("--keys: {} stands still; leave it out", scene.map.string());
  if (!options.keys.empty())
    map = std::make_shared<const BodyMap>(with_fewer_keys(*map, parse_keys(options.keys)));
  ExportRequest request = exported_session(scene, std::move(map));
  request.body = page_body(options, *request.map);
  if (request.body.motion) invocation.say(request.body.motion->warnings());
  request.format = format;
  if (!options.title.empty()) request.title = options.title;
  request.precision = parse_map_precision(options.precision);
  request.is_of_session = !options.session.empty();
  if (!script.empty()) {
    check(request);
    const RunRequest run = run_request(options, request, scene);
    invocation.say(check(run));
    request.run = recorded_run(run, invocation.progress);
  }
  if (options.is_live) add_trainer(options, scene, request, invocation);
  invocation.say(check(request));
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
      "  xraycast export map.exr --vessels vessels --live --device-model cobra-5f \\\n"
      "    --device-model guidewire-035-j --devices pigtail-5f,simmons2-5f -o trainer.html\n"
      "  xraycast export map.exr --vessels vessels --live --c-arm mobile-flat-panel --dose low --compression "
      "0.6 \\\n"
      "    -o mobile.html\n"
      "  xraycast export map.exr --vessels thorax-truth --live -o tasks.html \\\n"
      "    --exercise examples/exercises/1-left-renal.json --exercise "
      "examples/exercises/6-left-carotid.json\n"
      "  xraycast export map.exr --vessels vessels --script push.csv -o run.glb\n"
      "  xraycast export moving.exr --vessels vessels -o breathes.html --gate heart=0.75\n"
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
  add_body_options(
      *command, options->run.body,
      "Of a map that moves: the motion.json by which it was cast, by which vessels and a run's body "
      "move (default: the one that the map names)",
      false);
  command
      ->add_option(
          "--keys", options->keys,
          "Of a map that moves: how many of a mode's key maps the page holds (default: all), which makes "
          "it smaller. Repeat it for several modes")
      ->allow_extra_args(false)
      ->type_name("NAME=N");
  command->add_flag("--live", options->is_live,
                    "A page that steers: it simulates the instruments by itself, off line. With --script "
                    "it plays that run where a browser has no WebAssembly");
  command
      ->add_option("--devices", options->devices,
                   "With --live: instruments that may be taken instead of those of --device-model, presets "
                   "or JSON files, with commas between them")
      ->type_name("LIST");
  command
      ->add_option(
          "--exercise", options->exercises,
          "With --live: a task to choose in the page (docs/exercises.md), with its own instruments, or a "
          "folder of them. Repeat it for several")
      ->allow_extra_args(false)
      ->type_name("JSON|DIR");
  add_page_fluoroscope_options(*command, options->fluoroscope);
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
