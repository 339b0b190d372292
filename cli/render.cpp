#include "command.hpp"
#include "scene_options.hpp"
#include "view_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/png_file.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/projection_file.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/sampling/camera.hpp"
#include "xraycast/scene/annotations.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/session_file.hpp"
#include "xraycast/scene/vessels.hpp"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;
constexpr double kRadians = std::numbers::pi / 180;

struct Options {
  std::string map, output, session, cine, strengths;
  SceneOptions scene;
  std::optional<std::string> look, compositing, reconstruction;
  std::optional<double> wall_radius_mm;
  bool full_contrast = false, annotations = false;
  ViewOptions view;
  GreyOptions grey;
};

/// The session, where there is one, with what the other options say.
ViewSession resolve(const Options& options) {
  ViewSession scene;
  if (!options.session.empty()) scene = read_session(options.session);
  if (!options.map.empty()) scene.map = options.map;
  apply(options.scene, scene);
  if (scene.map.empty()) throw InputError("what to draw is missing: give a MAP.exr or --session");
  Style& style = scene.style;
  if (options.look) style.look = parse_look(*options.look);
  if (options.compositing) style.sampling.compositing = parse_compositing(*options.compositing);
  if (options.reconstruction)
    style.sampling.reconstruction =
        *options.reconstruction == "constant" ? Reconstruction::constant : Reconstruction::linear;
  if (options.wall_radius_mm) {
    if (style.sampling.compositing != Compositing::wall)
      throw InputError("--wall-radius {}: moves the walls of --compositing wall; give that too",
                       *options.wall_radius_mm);
    style.sampling.wall_radius_mm = options.wall_radius_mm;
  }
  if (!options.strengths.empty()) {
    style.strengths.clear();
    for (const double strength : parse_numbers(options.strengths, "--strengths"))
      style.strengths.push_back(static_cast<float>(strength));
  }
  if (options.full_contrast) {
    if (style.look != Look::fluoro)
      throw InputError("--full-contrast does not apply to --look surface; leave it out");
    style.full_contrast = true;
  }
  if (options.look == "surface" && scene.vessels.empty() && scene.catheter.empty() && !scene.steered)
    throw InputError("--look surface: there is nothing to shade; give --vessels or --catheter too");
  if (options.grey.gamma) style.window.gamma = *options.grey.gamma;
  if (options.grey.inverted) style.window.inverted = true;
  return scene;
}

/// The body map, recast when the session says so.
std::shared_ptr<const BodyMap> load_map(const ViewSession& scene, const Session& session) {
  auto map = std::make_shared<BodyMap>(read_body_map(scene.map));
  const auto& strengths = scene.style.strengths;
  if (!strengths.empty() && strengths.size() != static_cast<std::size_t>(map->geometry.layers()))
    throw InputError("{} for the {} of {}", pluralize(strengths.size(), "strength"),
                     pluralize(map->geometry.layers(), "layer"), scene.map.string());
  if (!scene.opacity || scene.basis.empty()) return map;
  ComputeDevice device(session.device);
  const Basis basis = read_basis(scene.basis);
  check_same_scan(map->geometry, scene.map.string(), basis.geometry, scene.basis.string());
  RecastSession recast(device, basis);
  return std::make_shared<BodyMap>(recast.recast(*scene.opacity));
}

void check_output(const Options& options) {
  if (options.cine.empty()) {
    check_projection_format(options.output);
    check_shown(options.grey, options.output);
    check_shown(options.full_contrast, "--full-contrast", options.output);
    check_shown(options.annotations, "--furniture", options.output);
    check_writable(options.output);
  } else if (is_animation(options.output)) {
    check_writable(options.output);
  } else {
    if (fs::path(options.output).has_extension() && !fs::is_directory(options.output))
      throw InputError("--cine with -o {}: has to be a folder for PNGs, or end in .gif", options.output);
    make_folder(options.output, options.output);
    check_writable(fs::path(options.output) / "frame-000.png");
  }
}

/// A frame in the session's window, or one for what is seen.
std::vector<std::uint8_t> draw(Renderer& renderer, const View& view, const ViewSession& scene,
                               const BodyBounds& bounds, bool with_annotations) {
  Style style = scene.style;
  if (!scene.has_window) style.window = automatic_window(renderer, view, style);
  std::vector<std::uint8_t> rgb = renderer.picture(view, style);
  const glm::dvec3 half(0, 0, bounds.half_height_mm);
  if (with_annotations)
    draw_annotations(rgb, view, annotations_of(view, bounds.centre_mm + half, bounds.centre_mm - half),
                     label(view));
  return rgb;
}

void render(const Options& options, Session& session) {
  check_output(options);
  const std::vector<double> cine_deg =
      options.cine.empty() ? std::vector<double>{} : parse_angles_deg(options.cine, "--cine");
  const ViewSession scene = resolve(options);
  const auto map = load_map(scene, session);
  std::vector<Surface> surfaces;
  const bool has_vessels = !scene.vessels.empty() && !scene.steered;
  if (has_vessels) surfaces.push_back(read_vessels(scene.vessels, scene.contrast_mg_ml));
  if (scene.steered)
    surfaces.push_back(catheter_surface(scene.steered->nodes_mm, scene.steered->radius_mm));
  else if (!scene.catheter.empty())
    surfaces.push_back(read_catheter(scene.catheter));

  const BodyBounds bounds = bounds_of(map->geometry);
  if (has_vessels)
    session.say(notes_on_place(surfaces.front().mesh.points_mm, bounds, scene.vessels.string()));
  View view = parse_view(options.view);
  if (!options.session.empty() && options.view.pixel_mm == 0) {
    if (view.width == 0) view.width = 640, view.height = 480;
    view = view_of(scene.camera, bounds, view.width, view.height);
  } else {
    view.centre_mm = bounds.centre_mm;
    view = fitted(view, bounds);
  }

  const HeadlessContext context;
  Renderer renderer;
  renderer.set_map(map);
  renderer.set_surfaces(surfaces);
  std::optional<RoadMap> road_map;
  if (scene.steered && scene.steered->has_road_map && !scene.vessels.empty())
    road_map.emplace(read_tree(scene.vessels));
  const auto frame = [&] {
    std::vector<std::uint8_t> rgb = draw(renderer, view, scene, bounds, options.annotations);
    if (road_map) draw_outline(road_map->outline(view), kRoadMapColour, view.width, rgb);
    return rgb;
  };
  const Stopwatch stopwatch;
  if (!cine_deg.empty()) {
    CineWriter writer(options.output, view.width, view.height);
    session.progress.begin("drawing", static_cast<std::int64_t>(cine_deg.size()), "frames");
    for (const double angle_deg : cine_deg) {
      view.angle_rad = angle_deg * kRadians;
      writer.add(frame());
      session.progress.advance();
    }
    writer.finish();
  } else if (is_picture(options.output)) {
    write_png(frame(), view.width, view.height, 3, options.output);
  } else {
    write_projection({view, renderer.tau(view, scene.style), 0}, options.output);
  }
  const double draw_ms = stopwatch.ms();
  Json result{{"map", scene.map.string()},
              {"image", to_json(view)},
              {"device", gl_device_name()},
              {"texture_B", renderer.texture_B()},
              {"frames", std::max<std::size_t>(1, cine_deg.size())}};
  std::string angles = label(view);
  if (!cine_deg.empty()) {
    result["image"].erase("angle_deg");
    result["angles_deg"] = cine_deg;
    angles = fmt::format("{} from {:g} to {:g} deg", pluralize(cine_deg.size(), "frame"), cine_deg.front(),
                         cine_deg.back());
  }
  session.report(result,
                 fmt::format("{}: {}, {} x {} pixels of {:.3g} mm, {:.1f} MB of textures, {:.0f} ms\n",
                             options.output, angles, view.width, view.height, view.pixel_mm,
                             static_cast<double>(renderer.texture_B()) / 1e6, draw_ms));
}

}  // namespace

void add_render(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = add_command(
      app, session, "render", "A frame of a body map, without a display",
      "  xraycast render map.exr -o lao30.png --angle 30\n"
      "  xraycast render map.exr -o frame.png --vessels thorax-truth --look surface --size 1280x720\n"
      "  xraycast render map.exr -o frames --cine 0:360:5\n"
      "  xraycast render --session operation.json -o frame.png",
      [options, &session] { render(*options, session); });
  command->add_option("MAP", options->map, "The body map (see `xraycast cast`)")->type_name("MAP.exr");
  command
      ->add_option("-o,--output", options->output,
                   ".exr, .tif, .nrrd hold float tau; .png what is shown; --cine: a folder of PNGs, or .gif")
      ->required()
      ->type_name("IMAGE");
  add_view_options(*command, options->view);
  add_scene_options(*command, options->scene);
  command
      ->add_option(
          "--look", options->look,
          "fluoro (default): vessels absorb too; surface: shaded and opaque; a float file then holds the "
          "optical depth in front of them")
      ->check(CLI::IsMember({"fluoro", "surface"}))
      ->type_name("NAME");
  command
      ->add_option("--compositing", options->compositing,
                   "path (default): by the length of the way through each shell; wall: the paper's")
      ->check(CLI::IsMember({"path", "wall"}))
      ->type_name("NAME");
  command
      ->add_option("--reconstruction", options->reconstruction,
                   "path: mu between the shells, linear (default) or constant")
      ->check(CLI::IsMember({"linear", "constant"}))
      ->type_name("NAME");
  command->add_option("--wall-radius", options->wall_radius_mm, "wall: where the outermost wall stands")
      ->check(CLI::PositiveNumber)
      ->type_name("MM");
  command->add_option("--strengths", options->strengths, "One factor a layer, innermost first; 0 hides it")
      ->type_name("S,S,...");
  add_grey_options(*command, options->grey);
  command->add_flag(
      "--full-contrast", options->full_contrast,
      "fluoro: vessels and catheter keep the contrast that the grey takes from the body's range");
  command->add_flag("--furniture", options->annotations,
                    "Letters where the patient's sides are (R L A P S I), the axis, and a scale bar");
  command
      ->add_option(
          "--cine", options->cine,
          "A turn around the body instead of one frame; a longer one's frames in the folder are removed")
      ->type_name("FROM:TO:STEP");
  command
      ->add_option("--session", options->session,
                   "What a session of the viewer shows; other options go first")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
