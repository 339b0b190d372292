#include "options/command.hpp"
#include "options/exercise_options.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/motion_options.hpp"
#include "options/run_options.hpp"
#include "options/scene_options.hpp"
#include "options/view_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stderr_log.hpp"
#include "xraycast/drawing/still_picture.hpp"
#include "xraycast/haptics/igtlink_device.hpp"
#include "xraycast/network/listen_address.hpp"
#include "xraycast/reports/run_comparison.hpp"
#include "xraycast/scene/map_motion.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/session_map.hpp"
#include "xraycast/scene/vessels.hpp"
#include "xraycast/serving/igtlink_outlet.hpp"
#include "xraycast/serving/live_screen.hpp"
#include "xraycast/serving/live_session.hpp"
#include "xraycast/serving/web_outlet.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <sys/resource.h>

namespace xraycast::cli {
namespace {

struct ServeArguments {
  std::vector<std::string> objects;
  std::string map, vessels, session, listen, haptic, exercise, report;
  RunOptions run{.instrument_models = {"cobra-5f"}};
  std::optional<std::string> web;  // an address
  std::vector<std::string> web_hosts;
  bool sends_unasked = false;
  double rate_hz = 30;  // as the window draws a moving catheter
  int bits = 8;
  ViewOptions view;
  GreyOptions grey;
  FluoroscopeArguments fluoroscope;
  const CLI::App* command = nullptr;

  bool is_scripted() const { return !run.script.empty(); }
  bool is_browsers_hub() const { return !is_scripted() && (haptic == "browser" || (haptic.empty() && web)); }
  bool is_steered() const { return !is_scripted() && haptic != "none" && !is_browsers_hub(); }
};

void check_device(const ServeArguments& options) {
  if (options.haptic == "script" && !options.is_scripted())
    throw InputError("--haptic script: there is no script; give --script too");
  if (options.is_scripted() && !options.haptic.empty() && options.haptic != "script")
    throw InputError("--script with --haptic {}: both move the hub; leave one of them out", options.haptic);
}

/// Where and under which names browsers connect; nothing without --web.
std::optional<WebServer::Options> parse_web(const ServeArguments& options) {
  if (options.web) {
    WebServer::Options web{.hosts = options.web_hosts};
    web.address = for_option(
        "--web", [&] { return parse_listen_address(*options.web); }, "; MAP goes before --web");
    WebServer::check(web);
    return web;
  }
  if (options.haptic == "browser")
    throw InputError("--haptic browser: no browser can connect; give --web too");
  if (!options.web_hosts.empty())
    throw InputError("--web-host {}: no browser can connect; give --web too", options.web_hosts[0]);
  return std::nullopt;
}

ViewSession resolve_served(const ServeArguments& options) {
  ViewSession scene;
  // Without it a thin catheter in a trunk is hardly visible; a session has its own setting.
  scene.style.full_contrast = true;
  if (!options.session.empty()) scene = read_session(options.session);
  scene.style.look = Look::fluoro;
  if (options.grey.gamma) scene.style.window.gamma = *options.grey.gamma;
  if (options.grey.inverted) scene.style.window.inverted = true;
  replace_file(scene.map, options.map);
  replace_file(scene.vessels, options.vessels);
  if (!options.objects.empty()) scene.implants = parse_objects(options.objects);
  if (scene.map.empty()) throw InputError("no body map is given; give a MAP.exr or --session");
  if (scene.vessels.empty())
    throw InputError(
        "there are no vessels to steer in; give --vessels, a folder that `xraycast segment` wrote");
  return scene;
}

/// The picture of the whole body, which the pose turns, moves and magnifies.
View resolve_detector(const ServeArguments& options, const ViewSession& scene, const BodyBounds& bounds) {
  constexpr int kUsualWidth = 640, kUsualHeight = 480, kMostPixels = 4096;
  View view = on_c_arm(options.fluoroscope.request, parse_view(options.view));
  if (view.width == 0 && view.pixel_mm == 0) {
    view.width = kUsualWidth;
    view.height = kUsualHeight;
  }
  if (!view.cone) view.cone = scene.pose.cone;
  view.centre_mm = bounds.centre_mm;
  view = fitted(view, bounds);
  if (view.width > kMostPixels || view.height > kMostPixels)
    throw InputError("pictures of {} x {} pixels: must be at most {} a side; give --size", view.width,
                     view.height, kMostPixels);
  return view;
}

CArmPose resolve_pose(const ServeArguments& options, const ViewSession& scene, const View& detector) {
  CArmPose pose = scene.pose;
  if (options.session.empty() || options.view.has_angle()) pose.lao_rad = detector.lao_rad;
  if (options.session.empty() || options.view.has_tilt()) pose.cranial_rad = detector.cranial_rad;
  if (options.view.pixel_mm > 0) pose.zoom = 1;
  pose.cone = detector.cone;
  return pose;
}

std::shared_ptr<IgtlinkDevice> open_server(const ServeArguments& options) {
  return for_option("--listen", [&] {
    return std::make_shared<IgtlinkDevice>(
        options.listen.empty() ? ListenAddress{} : parse_listen_address(options.listen), log_to_stderr,
        options.is_steered() ? options.run.instrument_models.size() : 0,
        IgtlinkWatching{.is_allowed = true, .is_unasked = options.sends_unasked});
  });
}

Intervention::Options steering_of(const ServeArguments& options, const RunRequest& request,
                                  const std::optional<Exercise>& exercise,
                                  const std::shared_ptr<IgtlinkDevice>& server) {
  Intervention::Options steering{.run = request, .exercise = exercise};
  steering.make_device = [server, is_steered = options.is_steered()]() -> std::unique_ptr<HapticDevice> {
    if (is_steered) return hubs_of(server);
    return std::make_unique<ManualDevice>("none");
  };
  return steering;
}

/// By which wall, contrast agent and map move: the one that is given, else the map's.
void add_motion(const BodyMap& map, BodyRequest& body, std::vector<std::string>& notes) {
  if (!body.motion) {
    body.motion = motion_of(map, {}, notes);
    return;
  }
  check_same_modes(map, *body.motion);
  notes = body.motion->warnings();
  if (!map.keys)
    notes.emplace_back(
        "the map stands still; one by `xraycast cast --motion` without --phase and --time moves with the "
        "run");
}

/// The page for browsers and its server.
std::unique_ptr<WebOutlet> open_web(const WebServer::Options& web, ExportRequest page,
                                    const BodyBounds& bounds) {
  page.still_png = still_png(page);
  return for_option("--web", [&] {
    return std::make_unique<WebOutlet>(web, export_bytes(page), bounds, page.live->has_hub, log_to_stderr);
  });
}

/// What this thread starts from now on, drawing included, gives way to the simulation and the network.
void give_way() {
  constexpr int kNicer = 10, kNicest = 19;
  setpriority(PRIO_PROCESS, 0, std::min(kNicest, getpriority(PRIO_PROCESS, 0) + kNicer));
}

void report_served(const Invocation& invocation, const LiveSession& live, const Intervention& intervention,
                   const IgtlinkDevice& server, const WebServer* web) {
  const LoopTiming& timing = intervention.run().now().timing;
  const IgtlinkCounts clients = server.counts();
  const double late_percent = 100.0 * static_cast<double>(timing.missed) /
                              static_cast<double>(std::max<std::int64_t>(1, timing.steps));
  const std::size_t browsers = web ? web->most_browsers() : 0;
  Json result{{"steps", timing.steps},
              {"late_steps", timing.missed},
              {"late_percent", late_percent},
              {"mean_step_ms", timing.mean_ms},
              {"frames", live.counts().frames},
              {"pictures", live.counts().pictures},
              {"fluoroscopy_s", intervention.fluoroscopy_s()},
              {"injected_ml", intervention.run().injected_ml()},
              {"clients", clients.clients},
              {"most_clients", clients.most_at_once},
              {"pictures_sent", clients.images_sent}};
  if (web) result["most_browsers"] = browsers;
  const LiveMonitor& monitor = intervention.run().monitor();
  if (const std::string report = monitor.json(false); !report.empty()) result["report"] = Json::parse(report);
  const std::string exercise = intervention.exercise() ? monitor.words() + "\n" : "";
  invocation.report(
      result,
      fmt::format("{}{}, {:.2f} % late; {} of the session; OpenIGTLink: {} drawn, {} sent to {}{}\n",
                  exercise, pluralize(timing.steps, "step"), late_percent,
                  pluralize(live.counts().frames, "frame"), pluralize(live.counts().pictures, "picture"),
                  clients.images_sent, pluralize(clients.clients, "client"),
                  web ? fmt::format("; web page: up to {} at once", pluralize(browsers, "browser")) : ""));
}

void serve(ServeArguments options, Invocation& invocation) {
  check_device(options);
  check_report_option(options.report);
  const auto web_options = parse_web(options);
  const auto fluoroscopy = parse_fluoroscope(options.fluoroscope);
  if (fluoroscopy && (options.grey.gamma || options.grey.inverted))
    throw InputError("--gamma and --inverted with a fluoroscope: its display sets the greys; leave them out");
  const ViewSession scene = resolve_served(options);
  const auto map = load_map(scene, invocation.device);
  const BodyBounds bounds = bounds_of(map->geometry);
  const View detector = resolve_detector(options, scene, bounds);

  const CArmPose pose = resolve_pose(options, scene, detector);
  const std::optional<Exercise> exercise =
      parse_exercise_option(*options.command, options.exercise, scene.vessels, options.run);
  RunRequest request = parse_run(options.run, scene.vessels);
  if (exercise) apply(*exercise, options.run, request);
  std::vector<std::string> notes_on_motion;
  add_motion(*map, request.body, notes_on_motion);
  const std::vector<std::string> notes = check(request);
  std::optional<ExportRequest> page;
  if (web_options) {
    page = live_session(scene, pose, map, request, options.is_browsers_hub());
    const std::vector<std::string> of_page = check(*page);
    notes_on_motion.insert(notes_on_motion.end(), of_page.begin(), of_page.end());
  }
  invocation.say(notes_on_place(*request.tree, bounds, scene.vessels.string()));
  invocation.say(notes_on_motion);
  invocation.say(notes);
  const auto server = open_server(options);
  Intervention intervention(steering_of(options, request, exercise, server));
  std::unique_ptr<WebOutlet> web;
  if (page) web = open_web(*web_options, std::move(*page), bounds);
  const std::vector<Implant> implants = open_objects(scene.implants, invocation);
  give_way();  // after the servers' threads
  LiveScreen screen(map, {.view = detector,
                          .style = scene.style,
                          .has_window = scene.has_window,
                          .implants = surfaces_of(implants),
                          .is_fine = options.bits == 16,
                          .fluoroscopy = fluoroscopy});
  LiveSession live(intervention, bounds, pose, screen, log_to_stderr);
  IgtlinkOutlet outlet(server);
  live.add(outlet);
  if (web) live.add(*web);
  live.step(0);  // what cannot be drawn ends it before a client comes
  // Also with --quiet: nobody else knows the page's token, nor a port that the system chose.
  if (web) log_to_stderr(fmt::format("open {} in a browser", web->server().page_address()));
  log_to_stderr(fmt::format("serving OpenIGTLink at {}; Ctrl+C ends it", to_string(server->address())));
  const OutputSeries files;  // the signal that ends it is no reason to leave the report out
  live.run(options.rate_hz, invocation.progress);
  keep_outputs();
  if (!options.report.empty()) write_report(options.report, intervention.run().monitor().json(true));
  report_served(invocation, live, intervention, *server, web ? &web->server() : nullptr);
  invocation.is_ended_by_signal = true;
}

}  // namespace

void add_serve(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<ServeArguments>();
  CLI::App* command = add_command(
      app, invocation, "serve", "Run a live session for other programs (OpenIGTLink) and for browsers",
      "  xraycast serve map.exr --vessels vessels\n"
      "  xraycast serve map.exr --vessels vessels --device-model simmons2-5f --c-arm mobile-flat-panel "
      "--size 640x480\n"
      "  xraycast serve map.exr --vessels vessels --device-model cobra-5f --device-model guidewire-035-j "
      "--web\n"
      "  xraycast serve map.exr --vessels vessels --script push.csv --listen 0.0.0.0:18944\n"
      "  xraycast serve moving.exr --vessels vessels --web --motion-speed 0.5\n"
      "  xraycast serve map.exr --vessels thorax-truth --web --report run.html \\\n"
      "    --exercise examples/exercises/1-left-renal.json",
      [options, &invocation] { serve(*options, invocation); });
  options->command = command;
  command->add_option("MAP", options->map, "The body map (see `xraycast cast`)")->type_name("MAP.exr");
  command
      ->add_option("--vessels", options->vessels,
                   "The vessels: a tree, or a folder that `xraycast segment` wrote")
      ->type_name("DIR|FILE");
  add_object_option(*command, options->objects);
  add_coaxial_options(*command, options->run);
  command
      ->add_option(
          "--haptic", options->haptic,
          "What moves the hub: openigtlink, a client (default); browser, the first one of --web (default "
          "with --web); script; or none")
      ->check(CLI::IsMember({"openigtlink", "browser", "script", "none"}))
      ->type_name("DEVICE");
  add_script_option(*command, options->run, "A script that moves the hub (see `xraycast simulate`)");
  add_exercise_option(
      *command, options->exercise,
      "A task to do (docs/exercises.md), whose progress clients are told. Its instruments and "
      "entry are those of --device-model and --entry where these are not given");
  add_report_option(*command, options->report, "Written as the session ends: what the instruments did");
  add_body_options(*command, options->run.body,
                   "How the body moves: the motion.json by which the map was cast; a map that moves names it",
                   false);
  command
      ->add_option("--listen", options->listen,
                   "Address to listen on (default 127.0.0.1:18944); port 0: a free one, which is printed")
      ->type_name("ADDRESS:PORT");
  command
      ->add_option("--web", options->web,
                   "Also serve the live session as a web page, by default on a free port of 127.0.0.1; the "
                   "address to open is printed")
      ->expected(0, 1)
      ->default_str(to_string(WebServer::Options{}.address))
      ->option_text("[ADDRESS:PORT]");
  command
      ->add_option("--web-host", options->web_hosts,
                   "Another host name by which browsers reach --web; repeatable")
      ->allow_extra_args(false)
      ->type_name("NAME");
  command->add_flag("--send-all", options->sends_unasked,
                    "Send pictures, shapes and tips to every client, also to those that do not ask");
  command->add_option("--rate", options->rate_hz, "Frames per second, 1 to 60")
      ->check(CLI::Range(1.0, 60.0))
      ->capture_default_str()
      ->type_name("HZ");
  command
      ->add_option(
          "--bits", options->bits,
          "Bits of a pixel: 8, what a display shows; 16, the same in finer greys, or a fluoroscope's "
          "detector codes")
      ->check(CLI::IsMember({8, 16}))
      ->capture_default_str()
      ->type_name("8|16");
  add_view_options(*command, options->view);
  command->remove_option(command->get_option("--isocentre"));  // clients move the table
  command->get_option("--size")->description("Picture size in pixels; default: 640x480, or a C-arm's own");
  add_grey_options(*command, options->grey);
  add_fluoroscope_options(*command, options->fluoroscope);
  command
      ->add_option("--session", options->session, "A session saved in the viewer; other options override it")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
