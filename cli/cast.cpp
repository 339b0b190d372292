#include "attenuation.hpp"
#include "map_output.hpp"
#include "options/command.hpp"
#include "xraycast/attenuation/materials.hpp"
#include "xraycast/attenuation/vessel_removal.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/body_fit.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/casting/rays_within.hpp"
#include "xraycast/casting/slab_caster.hpp"
#include "xraycast/geometry/curved_axis.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <memory>
#include <optional>
#include <variant>

namespace xraycast::cli {
namespace {

struct CastArguments {
  std::string input, basis, knots;
  MapOutput output;
  ScanOptions scan;
  std::string projection = "cylinder", centre = "auto", radius = "auto", centre_line, memory_limit,
              without_vessels;
  std::optional<std::string> outline;  ///< none: the body's, where there is one
  bool keeps_table = false;
  AttenuationOptions attenuation;
  std::optional<int> layers, angles, views;
  std::optional<std::string> radii_text;
  std::optional<std::variant<RadiiRule, std::vector<double>>> radii;  ///< of radii_text
};

constexpr int kAngles = 360, kViews = 36;

bool has_body_outline(const CastArguments& options) {
  return options.projection != "rectangle" && options.outline != "circle";
}

OutlineFinder finder_for(const CastArguments& options, const VolumeGeometry& volume) {
  return OutlineFinder(volume, {.finds_skin = has_body_outline(options), .keeps_table = options.keeps_table});
}

/// --centre vessels:DIR, X,Y, or X,Y,Z for a sphere, whose z is `z_mm` otherwise.
glm::dvec3 parse_centre(const CastArguments& options, double z_mm) {
  const std::string vessels = "vessels:";
  if (options.centre.starts_with(vessels))
    return centroid_mm(read_tree(std::filesystem::path(options.centre.substr(vessels.size())) / "tree.vtp"));
  const std::vector<double> centre = parse_numbers(options.centre, "--centre");
  const bool has_z = centre.size() == 3 && options.projection == "sphere";
  if (centre.size() != 2 && !has_z)
    throw InputError("--centre {}: must be auto, vessels:DIR or X,Y in mm, and for a sphere also X,Y,Z",
                     options.centre);
  return {centre[0], centre[1], has_z ? centre[2] : z_mm};
}

std::optional<double> given_radius_mm(const CastArguments& options) {
  if (options.radius == "auto") return std::nullopt;
  const std::vector<double> radius = parse_numbers(options.radius, "--radius");
  if (radius.size() != 1) throw InputError("--radius {}: must be auto or one number in mm", options.radius);
  return radius[0];
}

/// Suggests a smaller radius where a small part of the body, such as the arms, widens all shells.
void hint_at_radius(const CastArguments& options, const BodyOutline& outline, const Session& session) {
  constexpr double kMuch = 0.85;  // shells get at least 15 % thinner; heads and trunks without arms lie above
  const bool is_free = options.centre == "auto" && options.radius == "auto" && options.centre_line.empty() &&
                       !options.radii_text && !has_body_outline(options);
  if (!is_free || options.projection != "cylinder" || options.layers.value_or(1) < 2) return;
  const double radius_99_mm = std::ceil(outline.radius_99_mm);
  if (radius_99_mm < kMuch * outline.radius_mm)
    session.say(
        {fmt::format("99 % of the body lies within {:g} mm of the axis, the rest extends to {:.0f} mm: "
                     "--radius {:g} crops it and shows the body more sharply",
                     radius_99_mm, outline.radius_mm, radius_99_mm)});
}

/// The centre and radius as given by the user, else from the body.
BodyOutline resolve_outline(const CastArguments& options, const OutlineFinder& finder,
                            const Session& session) {
  BodyOutline outline{};
  if (options.centre == "auto" || options.radius == "auto") outline = finder.finish();
  hint_at_radius(options, outline, session);
  if (options.centre != "auto") outline.centre_mm = glm::dvec2(parse_centre(options, 0));
  outline.radius_mm = given_radius_mm(options).value_or(outline.radius_mm);
  return outline;
}

/// --radii: a rule, or at least two edges.
std::variant<RadiiRule, std::vector<double>> parse_radii(const std::string& text) {
  if (text == "equal-area") return RadiiRule::equal_area;
  if (text == "equal-thickness") return RadiiRule::equal_thickness;
  if (text == "near-skin") return RadiiRule::near_skin;
  std::vector<double> edges = parse_numbers(text, "--radii");
  if (edges.size() < 2)
    throw InputError(
        "--radii {}: must be equal-area, equal-thickness, near-skin or all edges in mm, innermost first",
        text);
  return edges;
}

/// The edges that --radii lists, in mm or as fractions; null where it names a rule.
const std::vector<double>* given_edges(const CastArguments& options) {
  return options.radii ? std::get_if<std::vector<double>>(&*options.radii) : nullptr;
}

/// Whether --radii are fractions of the body's outline.
bool has_fractions(const CastArguments& options) {
  const std::vector<double>* edges = given_edges(options);
  return edges && has_body_outline(options) && edges->back() <= 1;
}

/// The edges that --radii lists.
std::vector<double> resolve_edges(const CastArguments& options, std::vector<double> edges, double radius_mm) {
  if (options.layers && static_cast<std::size_t>(*options.layers) + 1 != edges.size())
    throw InputError("--radii {} makes {}, but --layers asks for {}; leave --layers out", *options.radii_text,
                     pluralize(edges.size() - 1, "layer"), *options.layers);
  if (has_fractions(options)) {
    for (double& edge : edges) edge *= radius_mm;
    return edges;
  }
  if (const auto given_mm = given_radius_mm(options); given_mm && *given_mm != edges.back())
    throw InputError("--radii {} ends at a radius other than --radius {}; leave --radius out",
                     *options.radii_text, options.radius);
  return edges;
}

std::vector<double> resolve_radii(const CastArguments& options, double radius_mm) {
  if (const std::vector<double>* edges = given_edges(options))
    return resolve_edges(options, *edges, radius_mm);
  const RadiiRule rule = options.radii               ? std::get<RadiiRule>(*options.radii)
                         : has_body_outline(options) ? RadiiRule::near_skin
                                                     : RadiiRule::equal_area;
  return shell_radii_mm(rule, options.layers.value_or(1), radius_mm);
}

void check_map_name(const std::filesystem::path& path) {
  if (extension_of(path) != ".exr") throw InputError("{}: the file name must end in .exr", path.string());
  check_writable(path);
}

/// The knots of the basis in HU; none without --keep-basis.
std::vector<double> resolve_knots(const CastArguments& options,
                                  const std::variant<Opacity, Spectrum>& attenuation) {
  if (options.basis.empty()) return {};
  const auto* opacity = std::get_if<Opacity>(&attenuation);
  if (!opacity || options.projection != "cylinder")
    throw InputError("--keep-basis {}: only cylinder maps cast with an opacity have a basis; leave it out",
                     options.basis);
  check_writable(options.basis);
  std::vector<double> knots_hu =
      options.knots.empty() ? useful_knots_hu(*opacity) : parse_numbers(options.knots, "--knots");
  validate_knots(knots_hu, options.knots.empty() ? "opacity " + opacity->name() : "--knots " + options.knots);
  return knots_hu;
}

/// Rejects options that have no effect on the chosen projection.
void check_applies(const CastArguments& options) {
  const auto check = [&](bool is_given, const char* option, std::initializer_list<const char*> projections) {
    if (is_given && std::ranges::find(projections, options.projection) == projections.end())
      throw InputError("{} does not apply to --projection {}; leave it out", option, options.projection);
  };
  check(options.layers.has_value(), "--layers", {"cylinder", "sphere"});
  check(options.radii_text.has_value(), "--radii", {"cylinder", "sphere"});
  check(options.angles.has_value(), "--angles", {"cylinder", "sphere"});
  check(options.views.has_value(), "--views", {"rectangle"});
  check(!options.centre_line.empty(), "--centre-line", {"cylinder"});
  check(options.outline.has_value(), "--outline", {"cylinder", "sphere"});
  check(options.keeps_table, "--keep-table", {"cylinder", "sphere"});
  if (options.keeps_table && !has_body_outline(options))
    throw InputError(
        "--keep-table: circles always include the table; leave out --keep-table or --outline circle");
  if (!options.centre_line.empty() && options.centre != "auto")
    throw InputError("--centre {} and --centre-line {}: give only one of them", options.centre,
                     options.centre_line);
}

/// Rejects wrong options before the scan is read.
void check(const CastArguments& options) {
  check_applies(options);
  check_map_name(options.output.map);
  if (!options.output.preview.empty()) check_picture_name(options.output.preview, options.output.preview);
  MapGeometry of_one_row;
  of_one_row.projection = parse_projection(options.projection);
  of_one_row.width = options.angles.value_or(kAngles);
  of_one_row.height = 1;
  of_one_row.views = options.views.value_or(kViews);
  of_one_row.radii_mm = resolve_radii(options, given_radius_mm(options).value_or(1));
  of_one_row.centre_mm = {options.centre == "auto" ? glm::dvec2(0) : glm::dvec2(parse_centre(options, 0))};
  validate(of_one_row, "map");
}

MapGeometry resolve_sphere(const CastArguments& options, const VolumeGeometry& volume,
                           const BodyOutline& outline) {
  const double middle_mm = 0.5 * (volume.lower_mm().z + volume.upper_mm().z);
  const glm::dvec3 centre_mm =
      options.centre == "auto" ? glm::dvec3(outline.centre_mm, middle_mm) : parse_centre(options, middle_mm);
  double radius_mm = outline.radius_mm;
  if (options.radius == "auto")  // must enclose the body at both ends of the scan too
    radius_mm =
        std::hypot(radius_mm, std::max(volume.upper_mm().z - centre_mm.z, centre_mm.z - volume.lower_mm().z));
  return sphere_map(volume, options.angles.value_or(kAngles), resolve_radii(options, radius_mm), centre_mm);
}

MapGeometry resolve_cylinder(const CastArguments& options, const VolumeGeometry& volume,
                             const BodyOutline& outline) {
  const int angles = options.angles.value_or(kAngles);
  if (options.centre_line.empty())
    return cylinder_map(volume, angles, resolve_radii(options, outline.radius_mm), outline.centre_mm);
  const std::vector<glm::dvec2> centre_mm =
      CurvedAxis::from_file(options.centre_line).centre_of_rows_mm(volume);
  double radius_mm = outline.radius_mm;
  if (options.radius == "auto") {  // must enclose the body wherever the centre goes
    double farthest_mm = 0;
    for (const glm::dvec2& centre : centre_mm)
      farthest_mm = std::max(farthest_mm, glm::distance(centre, outline.centre_mm));
    radius_mm += farthest_mm;
  }
  return cylinder_map(volume, angles, resolve_radii(options, radius_mm), centre_mm);
}

MapGeometry resolve_geometry(const CastArguments& options, const VolumeGeometry& volume,
                             const BodyOutline& outline) {
  if (options.projection == "rectangle")
    return rectangle_map(volume, options.views.value_or(kViews), outline.radius_mm, outline.centre_mm);
  return options.projection == "sphere" ? resolve_sphere(options, volume, outline)
                                        : resolve_cylinder(options, volume, outline);
}

/// The same with shells that follow the body, unless circles are asked for. Where there is no body, and the
/// user did not ask for its outline, they are circles too.
MapGeometry resolve_shells(const CastArguments& options, const VolumeGeometry& volume,
                           const OutlineFinder& finder, const Session& session) {
  const BodyOutline outline = resolve_outline(options, finder, session);
  MapGeometry circles = resolve_geometry(options, volume, outline);
  if (!has_body_outline(options)) return circles;
  try {
    return fit_to_body(circles, finder);
  } catch (const InputError& error) {
    if (options.outline || has_fractions(options)) throw;
    session.say({fmt::format("the shells are circles: {}", error.what())});
    CastArguments as_circles = options;
    as_circles.outline = "circle";
    return resolve_geometry(as_circles, volume, outline);
  }
}

/// The share of the scan's attenuation that lies outside of the map's shells, by a coarse projection.
double share_outside(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                     Progress& progress) {
  constexpr double kPixel_mm = 4;
  const VolumeGeometry& volume = scan.geometry();
  View view{.centre_mm = 0.5 * (volume.lower_mm() + volume.upper_mm()), .pixel_mm = kPixel_mm};
  view = fitted(view, volume,
                {glm::dvec2(view.centre_mm),
                 0.5 * glm::distance(glm::dvec2(volume.lower_mm()), glm::dvec2(volume.upper_mm()))});
  const auto sum = [](const std::vector<float>& taus) {
    double total = 0;
    for (const float tau : taus) total += tau;
    return total;
  };
  std::vector<RaySegment> segments;
  for (const PixelSegment& part : segments_within(view, geometry)) segments.push_back(part.segment);
  // One small picture takes less time than finding the constant blocks of the scan.
  const double whole = sum(project(scan, view, opacity, progress, {}, Sampling::everywhere).tau);
  return whole > 0 ? std::max(0.0, 1 - sum(project(scan, segments, opacity, progress)) / whole) : 0;
}

/// `--memory-limit` in bytes, by default the device's largest buffer.
std::int64_t memory_limit_B(const CastArguments& options, const ComputeDevice& device) {
  if (options.memory_limit.empty()) return device.info().max_allocation_B;
  std::size_t digits = 0;
  double number = 0;
  try {
    number = std::stod(options.memory_limit, &digits);
  } catch (const std::exception&) {
    digits = 0;
  }
  const std::string unit = options.memory_limit.substr(digits);
  const int shift = unit == "GiB" || unit == "G" ? 30 : unit == "MiB" || unit == "M" ? 20 : -1;
  if (digits == 0 || shift < 0 || !(number > 0 && number < 1e6))
    throw InputError("--memory-limit {}: must be a size such as 800M or 1.5G", options.memory_limit);
  return static_cast<std::int64_t>(std::ldexp(number, shift));
}

/// The result of a cast, and its timings.
struct Casting {
  CastResult result;
  LoadTimings timings;
  std::optional<Basis> basis{};
  double basis_ms = 0;
  double outline_ms = 0;            ///< to find the outline, and the share outside of it
  std::optional<double> outside{};  ///< see share_outside
};

Casting cast_resident(const CastArguments& options, const std::variant<Opacity, Spectrum>& attenuation,
                      const std::vector<double>& knots_hu, const Scan& scan, ComputeDevice& device,
                      Session& session) {
  Progress& progress = session.progress;
  OutlineFinder finder = finder_for(options, scan.source->geometry());
  LoadTimings timings;
  const SpectralScan resident = load(device, scan, options.attenuation, finder, timings, progress);
  hint_at_opacity(attenuation, scan.source->hu_range(), session);
  const Stopwatch finding;
  const MapGeometry geometry = resolve_shells(options, resident.native.geometry(), finder, session);
  const double finding_ms = finding.ms();
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  Casting casting{.result = spectrum
                                ? cast(resident, geometry, *spectrum, progress)
                                : cast(resident.native, geometry, std::get<Opacity>(attenuation), progress),
                  .timings = timings,
                  .outline_ms = finding_ms};
  if (!knots_hu.empty()) {
    const Stopwatch making;
    casting.basis = make_basis(resident.native, geometry, knots_hu, progress);
    casting.basis_ms = making.ms();
  }
  if (const auto* opacity = std::get_if<Opacity>(&attenuation);
      opacity && geometry.has_outline() && geometry.centre_mm.size() == 1) {
    const Stopwatch projecting;
    casting.outside = share_outside(resident.native, geometry, *opacity, progress);
    casting.outline_ms += projecting.ms();
  }
  return casting;
}

/// The scan, without the vessels that --without-vessels names.
Scan open(const CastArguments& options, Progress& progress) {
  Scan scan = open_scan(options.input, options.scan, progress);
  if (options.without_vessels.empty()) return scan;
  const std::filesystem::path file = std::filesystem::path(options.without_vessels) / "mask.nrrd";
  const Scan vessels = open_scan(file.string(), {}, progress);
  check_mask_grid(vessels.source->geometry(), scan.source->geometry(), "--without-vessels " + file.string());
  scan.source = std::make_unique<WithoutVessels>(std::move(scan.source), collect(*vessels.source, progress));
  return scan;
}

/// Casts slab by slab; reads the scan twice if the body's outline is needed first.
Casting cast_slabs(const CastArguments& options, const std::variant<Opacity, Spectrum>& attenuation,
                   Scan scan, std::int64_t limit_B, ComputeDevice& device, Session& session) {
  Progress& progress = session.progress;
  if (!options.basis.empty())
    throw InputError("--keep-basis {}: a basis needs the whole scan in memory; raise --memory-limit",
                     options.basis);
  const VolumeGeometry volume = scan.source->geometry();
  const std::int64_t slices = slab_slices_within(volume, limit_B);
  const auto* opacity = std::get_if<Opacity>(&attenuation);
  if (!opacity) throw InputError("a spectrum map needs the whole scan in memory; raise --memory-limit");
  OutlineFinder finder = finder_for(options, volume);
  LoadTimings timings;
  if (options.centre == "auto" || options.radius == "auto" || has_body_outline(options)) {
    const Stopwatch looking;
    look_through(*scan.source, finder, progress);
    scan = open(options, progress);
    timings.read_ms = looking.ms();
  }
  const Stopwatch finding;
  const MapGeometry geometry = resolve_shells(options, volume, finder, session);
  const double outline_ms = finding.ms();
  CastResult result = cast_by_slabs(device, *scan.source, geometry, *opacity, slices, timings, progress);
  hint_at_opacity(attenuation, scan.source->hu_range(), session);
  return {.result = std::move(result), .timings = timings, .outline_ms = outline_ms};
}

/// Whether the geometry is known before the first slice is read, and nothing needs the scan afterwards: slabs
/// then need less memory, and therefore less time.
bool is_best_by_slabs(const CastArguments& options, const std::variant<Opacity, Spectrum>& attenuation,
                      const VolumeGeometry& volume) {
  return volume.size.z > kMaxSlabSlices && options.centre != "auto" && options.radius != "auto" &&
         options.centre_line.empty() && options.basis.empty() && options.projection == "cylinder" &&
         !has_body_outline(options) && std::holds_alternative<Opacity>(attenuation);
}

/// One line on what the outline leaves out; none for circles.
std::string left_out_line(const MapGeometry& geometry, const std::optional<double>& outside,
                          bool keeps_table) {
  constexpr double kLeast = 1e-4;
  if (outside)
    return fmt::format(
        "left out: {} % of the scan's attenuation, outside the outline (table, clothes, and air where "
        "the opacity lets it attenuate)\n",
        *outside < kLeast ? fmt::format("less than {:g}", 100 * kLeast)
                          : fmt::format("{:.2g}", 100 * *outside));
  if (!geometry.has_outline()) return "";
  return keeps_table ? "left out: everything outside the outline, which includes the table\n"
                     : "left out: everything outside the outline; --keep-table includes the table\n";
}

void report_cast(const Casting& casting, const CastArguments& options, const std::string& opacity,
                 double write_ms, double total_ms, const Session& session) {
  const auto& [result, load_timings, basis, basis_ms, outline_ms, outside] = casting;
  const MapGeometry& geometry = result.map.geometry;
  Json json{{"input", options.input},
            {"map", to_json(result.map)},
            {"timings_ms",
             {{"read", load_timings.read_ms},
              {"upload", load_timings.upload_ms},
              {"outline", outline_ms},
              {"kernel", result.kernel_ms},
              {"write", write_ms},
              {"total", total_ms}}}};
  std::string text = fmt::format(
      "{}: {} of {} x {}, outline {}, radius {:.1f} mm about ({:.1f}, {:.1f}) mm, opacity {}\n"
      "read {:.0f} ms, upload {:.0f} ms, outline {:.0f} ms, kernel {:.0f} ms, write {:.0f} ms, total {:.0f} "
      "ms\n",
      options.output.map, pluralize(geometry.layers(), "layer"), pluralize(geometry.width, "angle"),
      pluralize(geometry.height, "slice"), geometry.has_outline() ? "body" : "circle", geometry.radius_mm(),
      geometry.centre_mm[0].x, geometry.centre_mm[0].y, opacity, load_timings.read_ms, load_timings.upload_ms,
      outline_ms, result.kernel_ms, write_ms, total_ms);
  if (outside) json["outside_share"] = *outside;
  text += left_out_line(geometry, outside, options.keeps_table);
  report_preview(geometry, options.output, json, text);
  if (basis) {
    json["basis"] = {{"file", options.basis}, {"knots_hu", basis->knots_hu}};
    json["timings_ms"]["basis"] = basis_ms;
    text += fmt::format("{}: basis of {}, {:.0f} ms\n", options.basis,
                        pluralize(basis->knots_hu.size(), "knot"), basis_ms);
  }
  session.report(json, text);
}

void cast_map(CastArguments options, Session& session) {
  const Stopwatch stopwatch;
  if (options.radii_text) options.radii = parse_radii(*options.radii_text);
  const auto attenuation = resolve(options.attenuation);
  check(options);
  const std::vector<double> knots_hu = resolve_knots(options, attenuation);
  Scan scan = open(options, session.progress);
  session.say_about(scan.info);
  const std::string source = fmt::format("{} {}", scan.info.format, options.input);
  const std::string frame_of_reference = frame_of_reference_uid(scan.info);

  ComputeDevice device(session.device);
  const std::int64_t limit_B = memory_limit_B(options, device);
  const VolumeGeometry& volume = scan.source->geometry();
  const bool fits = resident_bytes(volume) <= limit_B;
  Casting casting = fits && !is_best_by_slabs(options, attenuation, volume)
                        ? cast_resident(options, attenuation, knots_hu, scan, device, session)
                        : cast_slabs(options, attenuation, std::move(scan), limit_B, device, session);
  BodyMap& map = casting.result.map;
  map.source = source;
  map.frame_of_reference_uid = frame_of_reference;
  map.precision = parse_map_precision(options.output.precision);

  const Stopwatch writing;
  OutputSet outputs;
  write_map(map, options.output);
  if (casting.basis) {
    casting.basis->source = source;
    casting.basis->frame_of_reference_uid = frame_of_reference;
    write_basis(*casting.basis, options.basis);
  }
  outputs.commit();
  const double write_ms = writing.ms();
  const std::string opacity = std::visit([](const auto& one) { return one.name(); }, attenuation);
  report_cast(casting, options, opacity, write_ms, stopwatch.ms(), session);
}

}  // namespace

void add_cast(CLI::App& app, Session& session) {
  const auto options = std::make_shared<CastArguments>();
  CLI::App* command =
      add_command(app, session, "cast", "Cast a scan into a body map",
                  "  xraycast cast scans/chest/ -o chest.exr --preview chest.png\n"
                  "  xraycast cast chest.nii.gz -o chest.exr --layers 8 --opacity bilinear\n"
                  "  xraycast cast chest.nii.gz -o chest.exr --layers 8 --keep-basis chest.basis\n"
                  "  xraycast cast cta.nrrd -o cta.exr --opacity spectrum:80 --iodine vessels.nrrd\n"
                  "  xraycast cast head.nrrd -o head.exr --centre -3.5,12 --radius 110 --radii 0,40,80,110",
                  [options, &session] { cast_map(*options, session); });
  add_scan_argument(*command, options->input);
  add_map_output_options(*command, options->output);
  command
      ->add_option("--projection", options->projection,
                   "Ray geometry: cylinder (outwards from the axis), sphere (outwards from a point) or "
                   "rectangle (parallel)")
      ->check(CLI::IsMember({"cylinder", "sphere", "rectangle"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--layers", options->layers, "Number of concentric shells (default 1)")->type_name("K");
  command
      ->add_option(
          "--radii", options->radii_text,
          "near-skin (default), equal-area (default for circles), equal-thickness, or all edges in mm, "
          "innermost first; with a body outline, numbers up to 1 are fractions of it")
      ->type_name("RULE|MM,MM,...");
  command
      ->add_option("--outline", options->outline,
                   "What the shells follow: body (its outline, without the table) or circle (less accurate "
                   "with the same number of layers); default: body, or circle if no body is found")
      ->check(CLI::IsMember({"body", "circle"}))
      ->type_name("NAME");
  command->add_flag("--keep-table", options->keeps_table,
                    "Make the outline enclose everything in the scan, including the table");
  command
      ->add_option("--angles", options->angles,
                   "Rays per full turn around the axis, the map's width (default 360)")
      ->type_name("N");
  command->add_option("--views", options->views, "rectangle: number of views over 180 deg (default 36)")
      ->type_name("N");
  command
      ->add_option("--centre", options->centre,
                   "Position of the axis (sphere: of the centre) in mm (LPS); auto: the body's centroid; "
                   "vessels: the centroid of the vessels that `xraycast segment` wrote to DIR")
      ->capture_default_str()
      ->type_name("auto|vessels:DIR|X,Y[,Z]");
  command
      ->add_option(
          "--centre-line", options->centre_line,
          "cylinder: the axis follows a curve, monotonic in z: a CSV of x,y,z in mm (LPS) or a vessel tree")
      ->type_name("FILE[#BRANCH]");
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
