#include "options/angiography_options.hpp"
#include "options/command.hpp"
#include "options/exercise_options.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/motion_options.hpp"
#include "options/run_options.hpp"
#include "options/scene_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/network/listen_address.hpp"
#include "xraycast/window/viewer_window.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

struct ViewArguments {
  std::string map, scan, basis, session, exercise, report;
  SceneOptions scene;
  bool simulate = false;
  RunOptions run{.instrument_models = {"cobra-5f"}};
  std::string haptic = Intervention::Options{}.haptic, listen;
  FluoroscopeArguments fluoroscope;
  SubtractionOptions subtraction;
  const CLI::App* command = nullptr;

  bool has_run() const { return simulate || !run.script.empty() || !exercise.empty(); }
};

ViewSession resolve(const ViewArguments& options) {
  ViewSession session;
  if (!options.session.empty()) session = read_session(options.session);
  replace_file(session.map, options.map);
  replace_file(session.scan, options.scan);
  replace_file(session.basis, options.basis);
  apply(options.scene, session);
  return session;
}

/// The instrument to steer in a scene.
Intervention::Options simulation_of(const ViewArguments& options, const ViewSession& scene,
                                    const Invocation& program) {
  if (scene.vessels.empty())
    throw InputError("--simulate: give --vessels, a folder that `xraycast segment` wrote");
  if (!options.listen.empty()) for_option("--listen", [&] { return parse_listen_address(options.listen); });
  RunOptions run = options.run;
  std::optional<Exercise> exercise =
      parse_exercise_option(*options.command, options.exercise, scene.vessels, run);
  Intervention::Options simulation{
      .run = parse_run(run, scene.vessels), .haptic = options.haptic, .listen = options.listen};
  if (exercise) apply(*exercise, run, simulation.run);
  simulation.exercise = std::move(exercise);
  BodyRequest& body = simulation.run.body;
  if (body.motion) return simulation;
  const std::filesystem::path named =
      scene.map.empty() ? std::filesystem::path() : motion_named_by(scene.map);
  if (std::filesystem::exists(named))
    body.motion = std::make_shared<const Motion>(read_motion(named));
  else if (!named.empty())
    program.say(
        {fmt::format("the body stays at phase 0: {}, by which the map was cast, is not there; give --motion",
                     named.string())});
  return simulation;
}

/// Without a motion: the viewer knows the modes of a map that moves once it is opened.
bool may_move(const ViewSession& scene) {
  return !scene.basis.empty() || (!scene.map.empty() && !motion_named_by(scene.map).empty());
}

void view(const ViewArguments& options, const Invocation& invocation) {
  if (!options.has_run())
    check_not_given(*options.command, {"--device-model", "--entry", "--haptic", "--listen", "--report"},
                    "without a run; leave it out or give --simulate too");
  check_report_option(options.report);
  ViewSession scene = resolve(options);
  std::optional<Intervention::Options> simulation;
  std::optional<FluoroscopyOptions> fluoroscopy = parse_fluoroscope(options.fluoroscope);
  if (options.has_run()) {
    simulation = simulation_of(options, scene, invocation);
    if (!fluoroscopy) fluoroscopy = options_of({});
    // Without it a thin catheter in a trunk is hardly visible; a session has its own setting.
    if (options.session.empty()) scene.style.full_contrast = true;
  }
  const BodyRequest body = simulation ? simulation->run.body : body_request_of(options.run.body);
  if (body.motion) invocation.say(body.motion->warnings());
  std::optional<MaskPhase> mask_phase;
  if (!options.subtraction.mask_phase.empty()) {
    mask_phase = parse_mask_phase(options.subtraction.mask_phase);
    if (body.motion || !may_move(scene)) matching_of(options.subtraction, body.motion.get());
  }
  const OutputSeries files;
  run_viewer(scene, invocation.device, invocation.progress, simulation, fluoroscopy, body, mask_phase,
             options.report);
  invocation.progress.check();  // a signal closed it
}

}  // namespace

void add_view(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<ViewArguments>();
  CLI::App* command = add_command(
      app, invocation, "view", "Open the interactive viewer",
      "  xraycast view map.exr --basis map.basis --vessels thorax-truth\n"
      "  xraycast view --scan scans/chest/\n"
      "  xraycast view map.exr --vessels vessels --simulate --device-model simmons2-5f\n"
      "  xraycast view map.exr --vessels vessels --simulate --c-arm mobile-flat-panel --dose low\n"
      "  xraycast view moving.exr --vessels vessels --simulate --gate heart=0.75\n"
      "  xraycast view map.exr --vessels thorax-truth --exercise examples/exercises/1-left-renal.json \\\n"
      "    --report monday.json\n"
      "  xraycast view --session operation.json",
      [options, &invocation] { view(*options, invocation); });
  options->command = command;
  command->add_option("MAP", options->map, "The body map; without it, the scan is cast in 16 layers")
      ->type_name("MAP.exr");
  command->add_option("--scan", options->scan, "The scan, for true projections beside the map")
      ->type_name("INPUT");
  command->add_option("--basis", options->basis, "The map's basis, for editing the opacity")
      ->type_name("FILE");
  add_scene_options(*command, options->scene);
  command->add_flag(
      "--simulate", options->simulate,
      "Steer a catheter through the tree of --vessels, under the fluoroscope of a fixed C-arm by default");
  add_coaxial_options(*command, options->run);
  command->add_option("--haptic", options->haptic, "Input device that moves the hub")
      ->check(CLI::IsMember(Intervention::haptic_names()))
      ->capture_default_str()
      ->type_name("DEVICE");
  command
      ->add_option("--listen", options->listen, "openigtlink: address to listen on (default 127.0.0.1:18944)")
      ->type_name("ADDRESS:PORT");
  add_script_option(*command, options->run, "A script that moves the hub (see `xraycast simulate`)");
  add_body_options(*command, options->run.body,
                   "How the body moves: the motion.json by which the map was cast; a map that moves names it",
                   false);
  add_exercise_option(*command, options->exercise,
                      "A task to do (docs/exercises.md): the window shows it and what became of it. Its "
                      "instruments and entry are those of --device-model and --entry where these are not "
                      "given. As --simulate");
  add_report_option(*command, options->report,
                    "Written as the window closes, and by Ctrl+R: what the instruments did since the last "
                    "restart");
  add_mask_phase_option(*command, options->subtraction);
  add_fluoroscope_options(*command, options->fluoroscope);
  command->add_option("--session", options->session, "A session saved with Ctrl+S; other options override it")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
