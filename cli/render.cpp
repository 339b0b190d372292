#include "options/angiography_options.hpp"
#include "options/command.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/motion_options.hpp"
#include "options/scene_options.hpp"
#include "options/view_options.hpp"
#include "xraycast/acquisition/frame_file.hpp"
#include "xraycast/acquisition/map_acquisition.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/geometry/moved_vessels.hpp"
#include "xraycast/projection/projection_file.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/map_motion.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/session_map.hpp"
#include "xraycast/scene/vessels.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct RenderArguments {
  std::string map, output, session, cine, layer_weights;
  SceneOptions scene;
  MotionOptions motion;
  std::vector<std::string> road_map_phases;
  SubtractionOptions subtraction;
  std::optional<std::string> look, compositing, reconstruction;
  std::optional<double> wall_radius_mm;
  bool full_contrast = false, annotations = false;
  std::optional<double> seconds;
  ViewOptions view;
  GreyOptions grey;
  DicomOptions dicom;
  FluoroscopeArguments fluoroscope;

  bool is_cine() const { return !cine.empty() || seconds; }
};

void apply_style(const RenderArguments& options, Style& style) {
  SampleOptions& sampling = style.sampling;
  if (options.compositing) sampling.compositing = parse_compositing(*options.compositing);
  if (options.reconstruction && sampling.compositing == Compositing::wall)
    throw InputError("--reconstruction {}: applies only to --compositing path; leave it out",
                     *options.reconstruction);
  if (options.reconstruction) sampling.reconstruction = parse_reconstruction(*options.reconstruction);
  if (options.wall_radius_mm) sampling.wall_radius_mm = options.wall_radius_mm;
  if (!options.layer_weights.empty()) {
    const std::vector<double> weights = parse_numbers(options.layer_weights, "--layer-weights");
    style.layer_weights.assign(weights.begin(), weights.end());
  }
  if (options.full_contrast) style.full_contrast = true;
  if (options.grey.gamma) style.window.gamma = *options.grey.gamma;
  if (options.grey.inverted) style.window.inverted = true;
}

/// The session's style, overridden by the other options.
PictureOptions picture_of(const RenderArguments& options, const ViewSession& scene) {
  PictureOptions picture{.style = scene.style,
                         .has_window = scene.has_window,
                         .acquisition = {.fluoroscope = parse_fluoroscope(options.fluoroscope)},
                         .display = display_of(options.grey),
                         .has_annotations = options.annotations};
  apply_style(options, picture.style);
  if (options.look) choose_look(*options.look, picture);
  check(picture, !scene.vessels.empty() && !scene.steered,
        !scene.catheter.empty() || scene.steered || !scene.implants.empty());
  if (picture.acquisition.fluoroscope) check_linear_codes(options.dicom);
  return picture;
}

/// Throws InputError for an angle beside those of a cine.
void check_angle(const RenderArguments& options) {
  if (!options.cine.empty() && options.view.has_angle())
    throw InputError(
        "--angle (--lao) {:g} with --cine {}: --cine sets the angles of all frames; leave the single one out",
        options.view.angle_deg, options.cine);
}

void check_output(const RenderArguments& options) {
  if (!options.is_cine()) check_projection_format(options.output);
  if (!options.is_cine() || is_xa(options.output)) {
    check_shown(options.grey, options.output);
    check_shown(options.full_contrast, "--full-contrast", options.output);
    check_shown(options.annotations, "--annotations", options.output);
    check_writable(options.output);
  } else if (is_animation(options.output)) {
    check_writable(options.output);
  } else {
    make_frames_folder(
        options.output,
        fmt::format("{} with -o {}", options.cine.empty() ? "--seconds" : "--cine", options.output));
    check_writable(fs::path(options.output) / "frame-000.png");
  }
}

/// Throws InputError for a motion that moves nothing.
void check_motion(const RenderArguments& options, const ViewSession& scene) {
  if (!options.motion.motion.empty() && scene.vessels.empty())
    throw InputError(
        "--motion {}: moves vessels; give --vessels too, or leave it out: a map needs none, it moves by "
        "itself "
        "or stays as it was cast",
        options.motion.motion);
  if (!options.road_map_phases.empty() && !(scene.steered && scene.steered->has_road_map))
    throw InputError(
        "--road-map-phase {}: there is no road map; give a --session that has one, or leave it out",
        options.road_map_phases.front());
}

/// Of the vessels in a map that stands still; of one that moves, phases_of_frames() takes the instants.
MotionRequest motion_request(const RenderArguments& options, const BodyMap& map) {
  if (map.keys) return {};
  MotionRequest request = motion_request_of(options.motion);
  if (request.motion.empty() && (!request.phase.empty() || request.time_s || options.seconds))
    throw InputError(
        "{}: the map stands still; make one that moves by `xraycast cast --motion` without --phase and "
        "--time",
        options.map.empty() ? options.session : options.map);
  check(request);
  return request;
}

/// A road map shows the vessels as they were when it was taken, whatever the body does since.
VesselTree road_map_of(const ViewSession& session, const RenderArguments& options,
                       const Invocation& program) {
  VesselTree tree = read_tree(session.vessels);
  if (options.road_map_phases.empty()) return tree;
  const HeldMotion taken =
      held_motion({options.motion.motion, parse_phases(options.road_map_phases), {}}).held;
  MovedVessels<VesselTree> moved_tree = moved(tree, taken);
  program.say(moved_tree.lost.notes(session.vessels.string()));
  return std::move(moved_tree.vessels);
}

/// The session's map, vessels and instruments, of which the vessels move with the body.
MapScene read_scene(const ViewSession& session, const std::shared_ptr<const BodyMap>& map,
                    const MotionOfRequest& motion, const RenderArguments& options,
                    const Invocation& program) {
  MapScene scene{.map = map};
  program.say(motion.warnings);
  scene.implants = surfaces_of(open_objects(session.implants, program));
  if (session.steered) {
    scene.instruments = steered_surfaces(*session.steered);
    if (session.steered->has_road_map && !session.vessels.empty())
      scene.road_map = road_map_of(session, options, program);
    return scene;
  }
  if (!session.vessels.empty()) {
    std::vector<std::string> notes;
    const std::string vessels = session.vessels.string();
    if (!motion.phases.empty())
      check_same_instant(*map, session.map.string(), vessels + motion.suffix());
    else if (!map->keys && !instant_of(map->source).empty())
      program.say(
          {"the map shows the body at an instant of its motion, and the vessels are drawn as they are; give "
           "--motion and --phase if they are at rest"});
    scene.vessels = moved(read_vessels(session.vessels, session.contrast_mg_ml), motion.held, vessels, notes);
    scene.motion = motion_of(*map, options.motion.motion, notes);
    program.say(notes);
    program.say(
        notes_on_place(scene.vessels->mesh.points_mm, bounds_of(map->geometry), session.vessels.string()));
  }
  if (!session.catheter.empty()) scene.instruments.push_back(read_catheter(session.catheter));
  return scene;
}

/// The session's pose, but for what is given: a C-arm has its own detector. Without a session, the whole
/// body.
View resolve_view(const RenderArguments& options, const ViewSession& scene, const BodyBounds& bounds) {
  View view = on_c_arm(options.fluoroscope.request, parse_view(options.view));
  view.centre_mm = isocentre_mm(options.view, bounds);
  if (options.session.empty()) return fitted(view, bounds);
  constexpr int kUsualWidth = 640, kUsualHeight = 480;
  const bool is_sized = view.width > 0;
  const View seen =
      view_of(scene.pose, bounds, is_sized ? view.width : kUsualWidth, is_sized ? view.height : kUsualHeight);
  if (!options.view.has_isocentre()) view.centre_mm = seen.centre_mm;
  if (!options.view.has_angle()) view.lao_rad = seen.lao_rad;
  if (!options.view.has_tilt()) view.cranial_rad = seen.cranial_rad;
  if (!view.cone) view.cone = seen.cone;
  if (view.pixel_mm > 0) return fitted(view, bounds);
  view.width = seen.width;
  view.height = seen.height;
  view.pixel_mm = seen.pixel_mm;
  return view;
}

/// One view, or those of a cine.
std::vector<View> views_of(const View& view, std::span<const double> cine_deg) {
  std::vector<View> views(std::max<std::size_t>(1, cine_deg.size()), view);
  for (std::size_t i = 0; i < cine_deg.size(); ++i) views[i].lao_rad = glm::radians(cine_deg[i]);
  return views;
}

/// The phases of a map at each of its frames. They advance with the frames of a cine, unless phases are held;
/// a single one may be of the session's instant.
std::vector<std::vector<double>> phases_of_frames(const RenderArguments& options,
                                                  const std::map<std::string, double>& of_session,
                                                  const BodyMap& map, std::size_t frames, double frame_s,
                                                  const Invocation& program) {
  if (!map.keys) return {};
  const MotionRequest given{{}, parse_phases(options.motion.phases), options.motion.time_s};
  const Motion& rhythm = map.keys->phases().rhythm();
  std::vector<std::vector<double>> phases(frames, phases_of(rhythm, given));
  if (options.is_cine() && given.phase.empty())
    for (std::size_t i = 0; i < frames; ++i)
      phases[i] = rhythm.phases_at(given.time_s.value_or(0) + static_cast<double>(i) * frame_s);
  else if (given.phase.empty() && !given.time_s && !of_session.empty())
    phases.assign(frames, rhythm.phases_of(of_session));
  else if (given.phase.empty() && !given.time_s)
    program.say({"the map moves; this is phase 0 of its motion, give --phase or --time for another instant"});
  return phases;
}

/// Of --look dsa of a map that moves.
std::optional<MaskMatching> masks_of(const RenderArguments& options, const BodyMap& map) {
  check_subtraction(options.subtraction, options.look == "dsa", "");
  return matching_of(options.subtraction, map.keys ? &map.keys->phases().rhythm() : nullptr);
}

void draw(MapAcquisition& frames, std::span<const View> views, std::span<const std::vector<double>> phases,
          FrameFile& file, Progress& progress) {
  progress.begin("drawing", std::ssize(views), "frames");
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& view = views[i];
    if (!phases.empty()) frames.set_phases(phases[i]);
    if (file.is_shown())
      file.add(frames.picture(view));
    else
      file.add(frames.frame(view));
    progress.advance();
  }
  file.finish(frames.acquisition().record());
}

/// Of a cine that lasts so long.
std::size_t frames_within(double seconds, double frame_s) {
  constexpr double kMost = 10000;
  const double frames = std::round(seconds / frame_s);
  if (!(frames >= 1 && frames <= kMost))
    throw InputError("--seconds {:g}: makes {:.0f} frames; must make 1 to {:.0f}", seconds, frames, kMost);
  return static_cast<std::size_t>(frames);
}

void render(const RenderArguments& options, Invocation& invocation) {
  XaOptions xa = parse_xa(options.dicom, options.output);
  check_angle(options);
  check_output(options);
  const std::vector<double> cine_deg =
      options.cine.empty() ? std::vector<double>{} : parse_angles_deg(options.cine, "--cine");
  ViewSession scene = resolve_scene(options.session, options.map, options.scene);
  const PictureOptions picture = picture_of(options, scene);
  check_motion(options, scene);
  scene.style = picture.style;
  const auto& fluoroscope = picture.acquisition.fluoroscope;
  const auto map = load_map(scene, invocation.device);
  const MotionOfRequest motion = held_motion(motion_request(options, *map));
  xa.frame_of_reference_uid = frame_of_reference_for(xa.patient, map->frame_of_reference_uid);
  const View view = resolve_view(options, scene, bounds_of(map->geometry));
  const double frame_s = fluoroscope ? 1 / fluoroscope->pulses_per_s : CineWriter::kUsualFrame_s;
  std::vector<View> views = views_of(view, cine_deg);
  if (options.seconds) views.assign(frames_within(*options.seconds, frame_s), view);
  const auto phases = phases_of_frames(options, scene.instant, *map, views.size(), frame_s, invocation);

  check_dicom(view, xa, options.output, invocation);
  if (fluoroscope && !map->spectrum()) note_on_energies(invocation);
  const HeadlessContext context;
  Renderer renderer;
  MapAcquisition frames(renderer, read_scene(scene, map, motion, options, invocation), picture,
                        views.front());
  if (const auto masks = masks_of(options, *map)) frames.hold_masks(*masks);
  const Stopwatch stopwatch;
  FrameFile file(options.output,
                 {.is_cine = options.is_cine(), .most_frames = std::ssize(views), .frame_s = frame_s}, view,
                 picture.acquisition, xa);
  draw(frames, views, phases, file, invocation.progress);
  const double draw_ms = stopwatch.ms();
  note_on_saturation(frames.acquisition().is_saturated(), invocation);

  Json result{{"map", scene.map.string()},
              {"image", to_json(view)},
              {"device", gl_device_name()},
              {"texture_B", renderer.texture_B()},
              {"frames", views.size()}};
  if (!motion.phases.empty()) result["motion"] = to_json(motion);
  if (is_xa(options.output)) result["frame_of_reference"] = frame_of_reference_name(xa);
  std::string dose;
  if (const auto exposure = frames.acquisition().record()) {
    result["fluoroscope"] = to_json(*exposure);
    dose = summary(*exposure);
  }
  if (!phases.empty() && views.size() == 1) {
    Json& instant = result["phases"];
    for (std::size_t m = 0; m < phases[0].size(); ++m)
      instant[map->keys->phases().rhythm().modes()[m].name] = phases[0][m];
  }
  std::string angles = label(view);
  if (options.seconds)
    angles += fmt::format(", {} of {:g} s", pluralize(views.size(), "frame"), frame_s);
  else if (!phases.empty() && !options.is_cine())
    angles += instant_suffix(map->keys->phases(), phases[0]);
  if (!cine_deg.empty()) {
    result["image"].erase("angle_deg");
    result["angles_deg"] = cine_deg;
    angles = fmt::format("{} from {:g} to {:g} deg", pluralize(cine_deg.size(), "frame"), cine_deg.front(),
                         cine_deg.back());
  }
  invocation.report(result,
                    fmt::format("{}: {}, {} x {} pixels of {:.3g} mm, {:.1f} MB of textures, {:.0f} ms\n{}",
                                options.output, angles, view.width, view.height, view.pixel_mm,
                                static_cast<double>(renderer.texture_B()) / 1e6, draw_ms, dose));
}

}  // namespace

void add_render(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<RenderArguments>();
  CLI::App* command = add_command(
      app, invocation, "render", "Render a frame or a cine of a body map, without a display",
      "  xraycast render map.exr -o lao30.png --angle 30\n"
      "  xraycast render map.exr -o frame.png --vessels thorax-truth --look surface --size 1280x720\n"
      "  xraycast render map.exr -o dsa.png --vessels thorax-truth --look dsa --contrast 300\n"
      "  xraycast render inhaled.exr -o frame.png --vessels thorax-truth --motion motion.json --phase "
      "breath=1\n"
      "  xraycast render map.exr -o frames --cine 0:360:5\n"
      "  xraycast render moving.exr -o inhaled.png --phase breath=1\n"
      "  xraycast render moving.exr -o breath.gif --seconds 4\n"
      "  xraycast render map.exr -o run.dcm --cine=-30:30:2 --cone 780,1200\n"
      "  xraycast render map.exr -o fluoro.png --c-arm mobile-flat-panel --dose low --collimate 200,150\n"
      "  xraycast render --session operation.json -o frame.png",
      [options, &invocation] { render(*options, invocation); });
  command->add_option("MAP", options->map, "The body map (see `xraycast cast`)")->type_name("MAP.exr");
  command
      ->add_option(
          "-o,--output", options->output,
          ".exr, .tif and .nrrd hold float optical depths, or a fluoroscope's raw signal in keV; .dcm a "
          "DICOM XA image; .png, .jpg, .webp and others the displayed picture; with --cine: a folder of "
          "PNGs, a .gif or a .dcm")
      ->required()
      ->type_name("IMAGE");
  add_view_options(*command, options->view);
  add_scene_options(*command, options->scene);
  command
      ->add_option("--motion", options->motion.motion,
                   "How the vessels move: the motion.json by which the map was cast. A map that moves names "
                   "it; with one that was cast at an instant give --phase or --time too")
      ->type_name("FILE");
  command
      ->add_option(
          "--road-map-phase", options->road_map_phases,
          "The phase of a mode at which a session's road map was taken, and at which it stays, however "
          "the body moves; by default the vessels at rest. Repeat it for several modes")
      ->allow_extra_args(false)
      ->needs("--motion")
      ->type_name("NAME=0..1");
  command
      ->add_option(
          "--look", options->look,
          "fluoro (default): vessels and catheter attenuate X-rays; surface: they are shaded and "
          "opaque, and a float file holds the optical depth in front of them; dsa: vessels alone, as "
          "the difference from the picture without them, with the iodine of --contrast")
      ->check(CLI::IsMember({"fluoro", "surface", "dsa"}))
      ->type_name("NAME");
  command
      ->add_option("--compositing", options->compositing,
                   "How shells add up along a ray: path (default), by the path length in each; wall, once "
                   "per wall, as in the paper")
      ->check(CLI::IsMember({"path", "wall"}))
      ->type_name("NAME");
  command
      ->add_option("--reconstruction", options->reconstruction,
                   "path: attenuation across the shells, linear (default) or constant")
      ->check(CLI::IsMember({"linear", "constant"}))
      ->type_name("NAME");
  command->add_option("--wall-radius", options->wall_radius_mm, "wall: radius of the outermost wall")
      ->check(CLI::PositiveNumber)
      ->type_name("MM");
  command
      ->add_option("--layer-weights", options->layer_weights,
                   "One weight per layer, innermost first; 0 hides the layer")
      ->type_name("W,W,...");
  add_grey_options(*command, options->grey);
  add_dicom_options(*command, options->dicom);
  add_fluoroscope_options(*command, options->fluoroscope);
  command->add_flag(
      "--full-contrast", options->full_contrast,
      "fluoro: vessels and catheter keep full contrast where the grey window compresses the body's");
  command->add_flag("--annotations", options->annotations,
                    "Orientation letters (R L A P S I), the axis, and a scale bar");
  CLI::Option* cine =
      command
          ->add_option("--cine", options->cine,
                       "A rotational cine instead of one frame; TO is excluded; surplus frames of an earlier "
                       "cine are removed")
          ->type_name("FROM:TO:STEP");
  add_instant_options(*command, options->motion);
  add_mask_phase_option(*command, options->subtraction);
  command
      ->add_option(
          "--seconds", options->seconds,
          "Of a map that moves: a cine of so many seconds of its motion, from --time (default 0) on, "
          "20 frames a second or those of --pulse-rate; frames of --cine move likewise")
      ->excludes(cine)
      ->type_name("S");
  command
      ->add_option("--session", options->session,
                   "The scene of a viewer session (Ctrl+S); other options override it")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
