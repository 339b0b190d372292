#include "options/attenuation_options.hpp"
#include "options/command.hpp"
#include "options/map_output.hpp"
#include "options/motion_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/requests/cast_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

namespace xraycast::cli {
namespace {

/// The request, and what it is parsed from.
struct CastArguments {
  CastRequest request{.measures_outside = true};
  std::string input, basis, knots;
  MapOutput output;
  ScanOptions scan;
  std::string projection = "cylinder", centre = "auto", radius = "auto", outline, memory_limit,
              without_vessels;
  AttenuationOptions attenuation;
  MotionOptions motion;
  std::vector<std::string> keys;
  std::optional<std::string> radii;
};

/// --centre vessels:DIR, X,Y, or X,Y,Z for a sphere.
std::vector<double> parse_centre(const std::string& text, RayLayout ray_layout) {
  const std::string vessels = "vessels:";
  if (text.starts_with(vessels)) return centre_of(read_tree(text.substr(vessels.size())), ray_layout);
  std::vector<double> centre = parse_numbers(text, "--centre");
  if (centre.size() != 2 && (centre.size() != 3 || ray_layout != RayLayout::sphere))
    throw InputError("--centre {}: must be auto, vessels:DIR or X,Y in mm, and for a sphere also X,Y,Z",
                     text);
  return centre;
}

double parse_radius(const std::string& text) {
  const std::vector<double> radius = parse_numbers(text, "--radius");
  if (radius.size() != 1) throw InputError("--radius {}: must be auto or one number in mm", text);
  return radius[0];
}

/// --radii: a rule, or edges.
std::variant<RadiiRule, std::vector<double>> parse_radii(const std::string& text) {
  if (text.find_first_of("0123456789") == std::string::npos) return parse_radii_rule(text);
  return parse_numbers(text, "--radii");
}

/// --memory-limit in bytes.
std::int64_t parse_memory_limit(const std::string& text) {
  const std::size_t digits = std::min(text.find_first_of("GM"), text.size());
  const std::string unit = text.substr(digits);
  const int shift = unit == "GiB" || unit == "G" ? 30 : unit == "MiB" || unit == "M" ? 20 : -1;
  double number = 0;
  if (!parse_whole(text.substr(0, digits), number) || shift < 0 || !(number > 0 && number < 1e6))
    throw InputError("--memory-limit {}: must be a size such as 800M or 1.5G", text);
  return static_cast<std::int64_t>(std::ldexp(number, shift));
}

CastRequest request_of(const CastArguments& options) {
  CastRequest request = options.request;
  request.projection = parse_ray_layout(options.projection);
  if (options.centre != "auto") request.centre_mm = parse_centre(options.centre, request.projection);
  if (options.radius != "auto") request.radius_mm = parse_radius(options.radius);
  if (options.radii) request.radii = parse_radii(*options.radii);
  if (!options.outline.empty()) request.outline = parse_shell_outline(options.outline);
  request.opacity = attenuation_named(options.attenuation.opacity);
  request.iodine = options.attenuation.iodine;
  request.without_vessels = options.without_vessels;
  request.motion = motion_request_of(options.motion);
  request.keys = parse_keys(options.keys);
  if (!options.memory_limit.empty()) request.memory_limit_B = parse_memory_limit(options.memory_limit);
  if (!options.basis.empty())
    request.knots_hu =
        options.knots.empty() ? std::vector<double>() : parse_numbers(options.knots, "--knots");
  return request;
}

void check_outputs(const CastArguments& options) {
  check_map_name(options.output.map);
  check_writable(options.output.map);
  if (!options.output.preview.empty()) check_picture_name(options.output.preview, options.output.preview);
  if (!options.basis.empty()) check_writable(options.basis);
}

void report_cast(const Casting& casting, const CastArguments& options, double write_ms, double total_ms,
                 const Invocation& invocation) {
  const MapGeometry& geometry = casting.map.geometry;
  Json json{{"input", options.input},
            {"map", to_json(casting.map)},
            {"timings_ms",
             {{"read", casting.load.read_ms},
              {"upload", casting.load.upload_ms},
              {"outline", casting.outline_ms},
              {"kernel", casting.kernel_ms},
              {"write", write_ms},
              {"total", total_ms}}}};
  std::string text = fmt::format(
      "{}: {} of {} x {}{}, outline {}, radius {:.1f} mm about ({:.1f}, {:.1f}) mm, opacity {}\n"
      "read {:.0f} ms, upload {:.0f} ms, outline {:.0f} ms, kernel {:.0f} ms, write {:.0f} ms, total {:.0f} "
      "ms\n",
      options.output.map, pluralize(geometry.layers(), "layer"), pluralize(geometry.width, "angle"),
      pluralize(geometry.height, "slice"), casting.motion.suffix(),
      geometry.has_outline() ? "body" : "circle", geometry.radius_mm(), geometry.centre_mm[0].x,
      geometry.centre_mm[0].y,
      std::visit([](const auto& one) { return one.name(); }, casting.map.attenuation), casting.load.read_ms,
      casting.load.upload_ms, casting.outline_ms, casting.kernel_ms, write_ms, total_ms);
  if (!casting.motion.phases.empty()) json["motion"] = to_json(casting.motion);
  report_keys(casting.map, json, text);
  if (casting.outside_share) json["outside_share"] = *casting.outside_share;
  if (!casting.cut_off.empty()) text += casting.cut_off + "\n";
  if (!casting.left_out.empty()) text += invocation.spelled(casting.left_out) + "\n";
  report_preview(geometry, options.output, json, text);
  if (casting.basis) {
    json["basis"] = {{"file", options.basis}, {"knots_hu", casting.basis->knots_hu}};
    json["timings_ms"]["basis"] = casting.basis_ms;
    text += fmt::format("{}: basis of {}, {:.0f} ms\n", options.basis,
                        pluralize(casting.basis->knots_hu.size(), "knot"), casting.basis_ms);
  }
  invocation.report(json, text);
}

void cast_map(const CastArguments& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  const CastRequest request = request_of(options);
  check(request);
  check_precision(options.output, request.moves());
  check_outputs(options);
  std::optional<ScanInfo> opened;
  const auto open = [&](Progress& progress) {
    Scan scan = open_scan(options.input, options.scan, progress);
    if (!std::exchange(opened, scan.info)) invocation.say_about(scan.info);
    return scan;
  };
  ComputeDevice device(invocation.device);
  Casting casting = cast(request, open, device, invocation.progress);
  invocation.say(casting.notes);
  casting.describe(fmt::format("{} {}", opened->format, options.input), frame_of_reference_uid(*opened));
  choose_precision(casting.map, options.output);

  const Stopwatch writing;
  OutputSet outputs;
  write_map(casting.map, options.output);
  if (casting.basis) write_basis(*casting.basis, options.basis);
  outputs.commit();
  report_cast(casting, options, writing.ms(), stopwatch.ms(), invocation);
}

}  // namespace

void add_cast(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<CastArguments>();
  CLI::App* command = add_command(
      app, invocation, "cast", "Cast a scan into a body map",
      "  xraycast cast scans/chest/ -o chest.exr --preview chest.png\n"
      "  xraycast cast chest.nii.gz -o chest.exr --layers 8 --opacity bilinear\n"
      "  xraycast cast chest.nii.gz -o chest.exr --layers 8 --keep-basis chest.basis\n"
      "  xraycast cast cta.nrrd -o cta.exr --opacity spectrum:80 --iodine vessels.nrrd\n"
      "  xraycast cast head.nrrd -o head.exr --centre -3.5,12 --radius 110 --radii 0,40,80,110\n"
      "  xraycast cast chest.nii.gz -o inhaled.exr --layers 16 --motion motion.json --phase breath=1\n"
      "  xraycast cast chest.nii.gz -o moving.exr --layers 16 --motion motion.json --keys breath=4",
      [options, &invocation] { cast_map(*options, invocation); });
  add_scan_argument(*command, options->input);
  add_map_output_options(*command, options->output);
  command
      ->add_option("--projection", options->projection,
                   "Ray layout: cylinder (outwards from the axis), sphere (outwards from a point) or "
                   "rectangle (parallel)")
      ->check(CLI::IsMember({"cylinder", "sphere", "rectangle"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--layers", options->request.layers, "Number of concentric shells (default 1)")
      ->type_name("K");
  command
      ->add_option(
          "--radii", options->radii,
          "near-skin (default), equal-area (default for circles), equal-thickness, or all edges in mm, "
          "innermost first; with a body outline, numbers up to 1 are fractions of it")
      ->type_name("RULE|MM,MM,...");
  command
      ->add_option("--outline", options->outline,
                   "What the shells follow: body (its outline, without the table) or circle (less accurate "
                   "with the same number of layers); default: body, or circle if no body is found")
      ->check(CLI::IsMember({"body", "circle"}))
      ->type_name("NAME");
  command->add_flag("--keep-table", options->request.keep_table,
                    "Make the outline enclose everything in the scan, including the table");
  command
      ->add_option("--angles", options->request.angles,
                   "Rays per full turn around the axis, the map's width (default 360)")
      ->type_name("N");
  command
      ->add_option("--views", options->request.views, "rectangle: number of views over 180 deg (default 36)")
      ->type_name("N");
  command
      ->add_option("--centre", options->centre,
                   "Position of the axis (sphere: of the centre) in mm (LPS); auto: the body's centroid; "
                   "vessels: the centroid of the vessels that `xraycast segment` wrote to DIR")
      ->capture_default_str()
      ->type_name("auto|vessels:DIR|X,Y[,Z]");
  command
      ->add_option(
          "--centre-line", options->request.centre_line,
          "cylinder: the axis follows a curve, monotonic in z: a CSV of x,y,z in mm (LPS) or a vessel tree, "
          "of which a branch is chosen by its number or name; body: a straight line that leans as the body "
          "does")
      ->type_name("body|FILE[#BRANCH]");
  command
      ->add_option("--radius", options->radius,
                   "Outermost radius in mm, which also limits the outline; auto: encloses the body")
      ->capture_default_str()
      ->type_name("auto|MM");
  command
      ->add_option("--without-vessels", options->without_vessels,
                   "Remove the contrast agent from the vessels that `xraycast segment` wrote to DIR, so that "
                   "they can be drawn as a surface instead")
      ->type_name("DIR");
  add_motion_options(*command, options->motion);
  command
      ->add_option(
          "--keys", options->keys,
          fmt::format("--motion without --phase and --time makes a map that moves: key maps at phases "
                      "of its modes, between which frames are blended. This many of a mode (default: {} "
                      "of one that wraps, {} of any other). Repeat it for several modes",
                      kUsualOfCycle, kUsualOfStretch))
      ->allow_extra_args(false)
      ->type_name("NAME=N");
  add_attenuation_options(*command, options->attenuation);
  command
      ->add_option("--memory-limit", options->memory_limit,
                   "Size, such as 800M, above which a scan is cast slab by slab (default: the device's "
                   "largest buffer)")
      ->type_name("SIZE");
  CLI::Option* keep_basis =
      command
          ->add_option("--keep-basis", options->basis,
                       "Also write the basis from which `xraycast recast` makes maps with other opacities")
          ->type_name("FILE");
  command
      ->add_option("--knots", options->knots,
                   "CT numbers at which the slope of those opacities may change, at most 64 (default: the "
                   "knots of --opacity and a standard set)")
      ->needs(keep_basis)
      ->type_name("HU,HU,...");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
