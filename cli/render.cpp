#include "options/command.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/scene_options.hpp"
#include "options/session_map.hpp"
#include "options/view_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/projection_file.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/fluoroscope/subtraction.hpp"
#include "xraycast/sampling/camera.hpp"
#include "xraycast/scene/annotations.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/scene/session_file.hpp"
#include "xraycast/scene/vessels.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;
constexpr const char* kOldSpelling = "";  // options without a group are accepted, but not shown in --help

struct RenderArguments {
  std::string map, output, session, cine, layer_weights;
  SceneOptions scene;
  std::optional<std::string> look, compositing, reconstruction;
  std::optional<double> wall_radius_mm;
  bool full_contrast = false, annotations = false;
  ViewOptions view;
  GreyOptions grey;
  DicomOptions dicom;
  FluoroscopeArguments fluoroscope;

  bool subtracts() const { return look == "dsa"; }
};

void apply_sampling(const RenderArguments& options, SampleOptions& sampling) {
  if (options.compositing) sampling.compositing = parse_compositing(*options.compositing);
  if (options.reconstruction)
    sampling.reconstruction =
        *options.reconstruction == "constant" ? Reconstruction::constant : Reconstruction::linear;
  if (!options.wall_radius_mm) return;
  if (sampling.compositing != Compositing::wall)
    throw InputError("--wall-radius {}: applies only to --compositing wall; give that too",
                     *options.wall_radius_mm);
  sampling.wall_radius_mm = options.wall_radius_mm;
}

void apply_style(const RenderArguments& options, Style& style) {
  if (options.subtracts())
    style.shading = ShadingMode::fluoro;
  else if (options.look)
    style.shading = parse_shading_mode(*options.look);
  apply_sampling(options, style.sampling);
  if (!options.layer_weights.empty()) {
    const std::vector<double> weights = parse_numbers(options.layer_weights, "--layer-weights");
    if (!std::ranges::all_of(weights, [](double w) { return w >= 0 && w <= kMaxLayerWeight; }))
      throw InputError("--layer-weights {}: each must be 0 to {:g}", options.layer_weights, kMaxLayerWeight);
    style.layer_weights.assign(weights.begin(), weights.end());
  }
  if (options.full_contrast) {
    if (style.shading != ShadingMode::fluoro || options.subtracts())
      throw InputError("--full-contrast does not apply to --look {}; leave it out",
                       options.subtracts() ? "dsa" : "surface");
    style.full_contrast = true;
  }
  if (options.grey.gamma) style.window.gamma = *options.grey.gamma;
  if (options.grey.inverted) style.window.inverted = true;
}

/// The session, if given, overridden by the other options.
ViewSession resolve(const RenderArguments& options) {
  ViewSession scene = resolve_scene(options.session, options.map, options.scene);
  apply_style(options, scene.style);
  if (options.look == "surface" && scene.vessels.empty() && scene.catheter.empty() && !scene.steered)
    throw InputError("--look surface: there is nothing to shade; give --vessels or --catheter too");
  if (options.subtracts() && (scene.vessels.empty() || scene.steered))
    throw InputError("--look dsa: there are no vessels with contrast agent; give --vessels too");
  return scene;
}

/// Throws InputError for an angle beside those of a cine.
void check_angle(const RenderArguments& options) {
  if (!options.cine.empty() && options.view.has_angle())
    throw InputError(
        "--angle (--lao) {:g} with --cine {}: --cine sets the angles of all frames; leave the single one out",
        options.view.angle_deg, options.cine);
}

void check_output(const RenderArguments& options) {
  if (options.cine.empty()) check_projection_format(options.output);
  if (options.cine.empty() || is_xa(options.output)) {
    check_shown(options.grey, options.output);
    check_shown(options.full_contrast, "--full-contrast", options.output);
    check_shown(options.annotations, "--annotations", options.output);
    check_writable(options.output);
  } else if (is_animation(options.output)) {
    check_writable(options.output);
  } else {
    make_frames_folder(options.output, "--cine with -o " + options.output);
    check_writable(fs::path(options.output) / "frame-000.png");
  }
}

/// Vessels and catheter of the session.
std::vector<Surface> read_surfaces(const ViewSession& scene, const BodyBounds& bounds, Session& session) {
  std::vector<Surface> surfaces;
  if (!scene.vessels.empty() && !scene.steered) {
    surfaces.push_back(read_vessels(scene.vessels, scene.contrast_mg_ml));
    session.say(notes_on_place(surfaces.front().mesh.points_mm, bounds, scene.vessels.string()));
  }
  if (scene.steered)
    std::ranges::copy(steered_surfaces(*scene.steered), std::back_inserter(surfaces));
  else if (!scene.catheter.empty())
    surfaces.push_back(read_catheter(scene.catheter));
  return surfaces;
}

/// The session's camera, but for what is given: a C-arm has its own detector. Without a session, the whole
/// body.
View resolve_view(const RenderArguments& options, const ViewSession& scene, const BodyBounds& bounds,
                  const std::optional<FluoroscopyOptions>& fluoroscopy) {
  View view = on_c_arm(options.fluoroscope, fluoroscopy, parse_view(options.view));
  view.centre_mm = isocentre_mm(options.view, bounds);
  if (options.session.empty()) return fitted(view, bounds);
  constexpr int kUsualWidth = 640, kUsualHeight = 480;
  const bool is_sized = view.width > 0;
  const View seen = view_of(scene.camera, bounds, is_sized ? view.width : kUsualWidth,
                            is_sized ? view.height : kUsualHeight);
  if (!options.view.has_isocentre()) view.centre_mm = seen.centre_mm;
  if (!options.view.has_angle()) view.angle_rad = seen.angle_rad;
  if (!options.view.has_tilt()) view.tilt_rad = seen.tilt_rad;
  if (!view.cone) view.cone = seen.cone;
  if (view.pixel_mm > 0) return fitted(view, bounds);
  view.width = seen.width;
  view.height = seen.height;
  view.pixel_mm = seen.pixel_mm;
  return view;
}

/// Draws frames of a session with a context of its own.
class FrameRenderer {
 public:
  FrameRenderer(const ViewSession& scene, const std::shared_ptr<const BodyMap>& map, const BodyBounds& bounds,
                std::vector<Surface> surfaces, const RenderArguments& options)
      : scene_(scene),
        bounds_(bounds),
        surfaces_(std::move(surfaces)),
        grey_(options.grey),
        subtracts_(options.subtracts()),
        with_annotations_(options.annotations) {
    renderer_.set_map(map);
    renderer_.set_surfaces(surfaces_);
    if (scene.steered && scene.steered->has_road_map && !scene.vessels.empty())
      road_map_.emplace(read_tree(scene.vessels));
  }

  /// From now on frames are the fluoroscope's pulses. Its exposure control has settled on the first view.
  void use(const FluoroscopyOptions& options, const View& first, const BodyMap& map) {
    fluoroscope_.emplace(options, first, WaterPath(map));
    show_vessels(!subtracts_);
    fluoroscope_->settle(renderer_.tau(first, scene_.style));
    fluoroscope_->hold_technique(subtracts_);
    show_vessels(true);
  }

  /// A fluoroscope's next pulse.
  const FluoroscopyFrame& pulse(const View& view) {
    fluoroscope_->set_view(view);
    const FluoroscopyFrame& frame = fluoroscope_->expose(renderer_.tau(view, scene_.style));
    technique_ = frame.technique;
    is_saturated_ = is_saturated_ || frame.is_saturated;
    return frame;
  }
  const std::optional<Fluoroscope>& fluoroscope() const { return fluoroscope_; }
  bool subtracts() const { return subtracts_; }
  const Technique& technique() const { return technique_; }  ///< of the last pulse
  bool is_saturated() const { return is_saturated_; }        ///< in any pulse

  /// The displayed picture: a fluoroscope's, or in the session's grey window, or in an automatic one for the
  /// view.
  std::vector<std::uint8_t> picture(const View& view) {
    std::vector<std::uint8_t> rgb = subtracts_     ? subtracted_picture(view)
                                    : fluoroscope_ ? rgb_of(displayed(pulse(view).shown, grey_))
                                                   : grey_picture(view);
    const glm::dvec3 half(0, 0, bounds_.half_height_mm);
    if (with_annotations_)
      draw_annotations(rgb, view, annotations_of(view, bounds_.centre_mm + half, bounds_.centre_mm - half),
                       label(view));
    if (road_map_) draw_outline(road_map_->outline(view), kRoadMapColour, view.width, rgb);
    return rgb;
  }

  /// Optical depths, or their differences from those without the vessels.
  std::vector<float> tau(const View& view) {
    if (!subtracts_) return measured_tau(view);
    Subtraction subtraction(view.width, view.height);
    show_vessels(false);
    settle_lag(view);
    subtraction.add_to_mask(measured_tau(view));
    show_vessels(true);
    std::vector<float> tau = measured_tau(view);
    subtraction.subtract(tau, tau);
    if (fluoroscope_) fluoroscope_->clear_behind_blades(tau);
    return tau;
  }
  std::size_t texture_B() const { return renderer_.texture_B(); }

 private:
  std::vector<std::uint8_t> grey_picture(const View& view) {
    Style style = scene_.style;
    if (!scene_.has_window) style.window = automatic_window(renderer_, view, style);
    return renderer_.picture(view, style);
  }
  /// Of the surfaces the first are the vessels.
  void show_vessels(bool shows) {
    const std::span<const Surface> all(surfaces_);
    renderer_.set_surfaces(shows || surfaces_.empty() ? all : all.subspan(1));
  }
  /// Runs of masks and of filled frames each have their own lag.
  void settle_lag(const View& view) {
    if (!fluoroscope_) return;
    fluoroscope_->set_view(view);
    fluoroscope_->settle(renderer_.tau(view, scene_.style));
  }

  /// All frames have the window of the first.
  std::vector<std::uint8_t> subtracted_picture(const View& view) {
    const std::vector<float> difference = tau(view);
    if (!window_) window_ = automatic_subtraction_window(difference);
    return rgb_of(displayed(subtraction_greys(difference, *window_), grey_));
  }

  /// With a fluoroscope the optical depths that its detector measures.
  std::vector<float> measured_tau(const View& view) {
    return fluoroscope_ ? measured_depths(pulse(view)) : renderer_.tau(view, scene_.style);
  }

  const ViewSession& scene_;
  BodyBounds bounds_;
  std::vector<Surface> surfaces_;
  GreyOptions grey_;
  bool subtracts_, with_annotations_;
  std::optional<SubtractionWindow> window_;
  HeadlessContext context_;
  Renderer renderer_;
  std::optional<RoadMap> road_map_;
  std::optional<Fluoroscope> fluoroscope_;
  Technique technique_;
  bool is_saturated_ = false;
};

View turned(View view, double angle_deg) {
  view.angle_rad = glm::radians(angle_deg);
  return view;
}

void write_cine(FrameRenderer& frames, View view, std::span<const double> angles_deg,
                const std::string& output, Progress& progress) {
  const auto& fluoroscope = frames.fluoroscope();
  CineWriter writer(output, view.width, view.height,
                    fluoroscope ? 1 / fluoroscope->options().pulses_per_s : CineWriter::kUsualFrame_s);
  progress.begin("drawing", static_cast<std::int64_t>(angles_deg.size()), "frames");
  for (const double angle_deg : angles_deg) {
    view.angle_rad = glm::radians(angle_deg);
    writer.add(frames.picture(view));
    progress.advance();
  }
  writer.finish();
}

/// Noise in a difference goes below zero, which DICOM's pixels here cannot: zero lies a little darker.
std::vector<float> xa_depths(FrameRenderer& frames, const View& view) {
  std::vector<float> tau = frames.tau(view);
  constexpr float kRoom = 1;
  if (frames.fluoroscope() && frames.subtracts())
    for (float& depth : tau) depth += kRoom;
  return tau;
}

void write_xa_cine(FrameRenderer& frames, View view, std::span<const double> angles_deg,
                   const std::string& output, XaOptions options, Progress& progress) {
  const auto& fluoroscope = frames.fluoroscope();
  const bool has_codes = fluoroscope && !frames.subtracts();
  if (has_codes) options.code_bits = fluoroscope->bits();
  if (fluoroscope) options.frame_time_ms = 1000 / fluoroscope->options().pulses_per_s;
  XaWriter writer(output, view, std::ssize(angles_deg), options);
  progress.begin("drawing", std::ssize(angles_deg), "frames");
  for (const double angle_deg : angles_deg) {
    view.angle_rad = glm::radians(angle_deg);
    if (has_codes)
      writer.add_codes(view, frames.pulse(view).codes);
    else
      writer.add(view, xa_depths(frames, view));
    progress.advance();
  }
  if (fluoroscope)
    if (const auto exposure = exposure_of(*fluoroscope, frames.technique())) writer.set_exposure(*exposure);
  writer.finish();
}

void write_frame(FrameRenderer& frames, const View& view, const std::string& output, const XaOptions& xa,
                 Progress& progress) {
  if (is_picture(output))
    write_picture(frames.picture(view), view.width, view.height, 3, output);
  else if (frames.fluoroscope() && !frames.subtracts())
    write_fluoroscopy(*frames.fluoroscope(), frames.pulse(view), view, output, {}, xa);
  else if (is_xa(output))
    write_xa_cine(frames, view, std::array{glm::degrees(view.angle_rad)}, output, xa, progress);
  else
    write_projection({view, frames.tau(view), 0}, output, 1, false, xa);
}

/// Throws InputError for options that do not apply to a fluoroscope's picture.
void check_fluoroscopy(const RenderArguments& options, const Style& style) {
  check_fluoroscopy(style.shading, options.dicom);
  if (options.full_contrast)
    throw InputError("--full-contrast does not apply to a fluoroscope's picture; leave it out");
}

void render(const RenderArguments& options, Session& session) {
  const auto fluoroscopy = parse_fluoroscope(options.fluoroscope);
  XaOptions xa = parse_xa(options.dicom, options.output);
  check_angle(options);
  check_output(options);
  const std::vector<double> cine_deg =
      options.cine.empty() ? std::vector<double>{} : parse_angles_deg(options.cine, "--cine");
  const ViewSession scene = resolve(options);
  if (fluoroscopy) check_fluoroscopy(options, scene.style);
  const auto map = load_map(scene, session);
  xa.frame_of_reference_uid = frame_of_reference_for(xa.patient, map->frame_of_reference_uid);
  const BodyBounds bounds = bounds_of(map->geometry);
  const View view = resolve_view(options, scene, bounds, fluoroscopy);

  check_dicom(view, xa, options.output, session);
  FrameRenderer frames(scene, map, bounds, read_surfaces(scene, bounds, session), options);
  if (fluoroscopy) {
    if (!map->spectrum) note_on_energies(session);
    frames.use(*fluoroscopy, cine_deg.empty() ? view : turned(view, cine_deg.front()), *map);
  }
  const Stopwatch stopwatch;
  if (cine_deg.empty())
    write_frame(frames, view, options.output, xa, session.progress);
  else if (is_xa(options.output))
    write_xa_cine(frames, view, cine_deg, options.output, xa, session.progress);
  else
    write_cine(frames, view, cine_deg, options.output, session.progress);
  const double draw_ms = stopwatch.ms();
  note_on_saturation(frames.is_saturated(), session);

  Json result{{"map", scene.map.string()},
              {"image", to_json(view)},
              {"device", gl_device_name()},
              {"texture_B", frames.texture_B()},
              {"frames", std::max<std::size_t>(1, cine_deg.size())}};
  if (is_xa(options.output)) result["frame_of_reference"] = frame_of_reference_name(xa);
  std::string dose;
  if (const auto& fluoroscope = frames.fluoroscope()) {
    result["fluoroscope"] = to_json(*fluoroscope, frames.technique());
    dose = summary(*fluoroscope, frames.technique());
  }
  std::string angles = label(view);
  if (!cine_deg.empty()) {
    result["image"].erase("angle_deg");
    result["angles_deg"] = cine_deg;
    angles = fmt::format("{} from {:g} to {:g} deg", pluralize(cine_deg.size(), "frame"), cine_deg.front(),
                         cine_deg.back());
  }
  session.report(result,
                 fmt::format("{}: {}, {} x {} pixels of {:.3g} mm, {:.1f} MB of textures, {:.0f} ms\n{}",
                             options.output, angles, view.width, view.height, view.pixel_mm,
                             static_cast<double>(frames.texture_B()) / 1e6, draw_ms, dose));
}

}  // namespace

void add_render(CLI::App& app, Session& session) {
  const auto options = std::make_shared<RenderArguments>();
  CLI::App* command = add_command(
      app, session, "render", "Render a frame or a cine of a body map, without a display",
      "  xraycast render map.exr -o lao30.png --angle 30\n"
      "  xraycast render map.exr -o frame.png --vessels thorax-truth --look surface --size 1280x720\n"
      "  xraycast render map.exr -o dsa.png --vessels thorax-truth --look dsa --contrast 300\n"
      "  xraycast render map.exr -o frames --cine 0:360:5\n"
      "  xraycast render map.exr -o run.dcm --cine=-30:30:2 --cone 780,1200\n"
      "  xraycast render map.exr -o fluoro.png --c-arm mobile-flat-panel --dose low --collimate 200,150\n"
      "  xraycast render --session operation.json -o frame.png",
      [options, &session] { render(*options, session); });
  command->add_option("MAP", options->map, "The body map (see `xraycast cast`)")->type_name("MAP.exr");
  command
      ->add_option(
          "-o,--output", options->output,
          ".exr, .tif and .nrrd hold float optical depths, or a fluoroscope's raw signal in keV; .dcm a "
          "DICOM XA image; .png, .jpg, .webp and others the displayed picture; with --cine: a folder of "
          "PNGs, a "
          ".gif or a .dcm")
      ->required()
      ->type_name("IMAGE");
  add_view_options(*command, options->view);
  add_scene_options(*command, options->scene);
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
  constexpr const char* kWeights = "One weight per layer, innermost first; 0 hides the layer";
  command->add_option("--layer-weights", options->layer_weights, kWeights)->type_name("W,W,...");
  command->add_option("--strengths", options->layer_weights, kWeights)->group(kOldSpelling);
  add_grey_options(*command, options->grey);
  add_dicom_options(*command, options->dicom);
  add_fluoroscope_options(*command, options->fluoroscope);
  command->add_flag(
      "--full-contrast", options->full_contrast,
      "fluoro: vessels and catheter keep full contrast where the grey window compresses the body's");
  constexpr const char* kAnnotations = "Orientation letters (R L A P S I), the axis, and a scale bar";
  command->add_flag("--annotations", options->annotations, kAnnotations);
  command->add_flag("--furniture", options->annotations, kAnnotations)->group(kOldSpelling);
  command
      ->add_option("--cine", options->cine,
                   "A rotational cine instead of one frame; TO is excluded; surplus frames of an earlier "
                   "cine are removed")
      ->type_name("FROM:TO:STEP");
  command
      ->add_option("--session", options->session,
                   "The scene of a viewer session (Ctrl+S); other options override it")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
