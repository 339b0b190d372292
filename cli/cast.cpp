#include "attenuation.hpp"
#include "command.hpp"
#include "xraycast/atomic_file.hpp"
#include "xraycast/caster.hpp"
#include "xraycast/error.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

struct Options {
  std::string input, output, preview;
  ScanOptions scan;
  std::string projection = "cylinder", radii = "equal-area", centre = "auto", radius = "auto",
              window = "auto";
  AttenuationOptions attenuation;
  std::optional<int> layers;
  int angles = 360;
};

/// The centre and radius that the user gave, the rest from the body.
BodyOutline resolve_outline(const Options& options, const OutlineFinder& finder) {
  BodyOutline outline{};
  if (options.centre == "auto" || options.radius == "auto") outline = finder.finish();
  if (options.centre != "auto") {
    const std::vector<double> centre = parse_numbers(options.centre, "--centre");
    if (centre.size() != 2) throw InputError("--centre {}: has to be auto or X,Y in mm", options.centre);
    outline.centre_mm = {centre[0], centre[1]};
  }
  if (options.radius != "auto") outline.radius_mm = parse_numbers(options.radius, "--radius").front();
  return outline;
}

std::vector<double> resolve_radii(const Options& options, double radius_mm) {
  const int layers = options.layers.value_or(1);
  if (options.radii == "equal-area") return shell_radii_mm(RadiiRule::equal_area, layers, radius_mm);
  if (options.radii == "equal-thickness")
    return shell_radii_mm(RadiiRule::equal_thickness, layers, radius_mm);
  const std::vector<double> edges_mm = parse_numbers(options.radii, "--radii");
  if (edges_mm.size() < 2)
    throw InputError("--radii {}: has to be equal-area, equal-thickness or all edges in mm, innermost first",
                     options.radii);
  if (options.layers && static_cast<std::size_t>(layers) + 1 != edges_mm.size())
    throw InputError("--radii {} makes {} layers, but --layers asks for {}", options.radii,
                     edges_mm.size() - 1, layers);
  return edges_mm;
}

/// Rejects what can be known to be wrong before the scan is read.
void check(const Options& options) {
  check_writable(options.output);
  if (!options.preview.empty()) check_writable(options.preview);
  resolve_radii(options, options.radius == "auto" ? 1 : parse_numbers(options.radius, "--radius").front());
}

Json json_of(const Options& options, const MapGeometry& map, const LoadTimings& load, double kernel_ms,
             double write_ms, double total_ms) {
  return {{"input", options.input},
          {"map",
           {{"width", map.width},
            {"height", map.height},
            {"layers", map.layers()},
            {"radii_mm", map.radii_mm},
            {"centre_mm", {map.centre_mm[0].x, map.centre_mm[0].y}}}},
          {"timings_ms",
           {{"read", load.read_ms},
            {"upload", load.upload_ms},
            {"kernel", kernel_ms},
            {"write", write_ms},
            {"total", total_ms}}}};
}

void cast_map(const Options& options, Session& session) {
  const auto start = Clock::now();
  const auto attenuation = resolve(options.attenuation);
  check(options);
  const Scan scan = open_scan(options.input, options.scan, session.progress);
  session.say(scan.info.warnings);
  session.say(scan.info.notes);

  Device device(session.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings load_timings;
  const SpectralScan resident =
      load(device, scan, options.attenuation, finder, load_timings, session.progress);
  const BodyOutline outline = resolve_outline(options, finder);
  const MapGeometry geometry = cylinder_map(resident.native.geometry(), options.angles,
                                            resolve_radii(options, outline.radius_mm), outline.centre_mm);
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  CastResult result = spectrum
                          ? cast(resident, geometry, *spectrum, session.progress)
                          : cast(resident.native, geometry, std::get<Opacity>(attenuation), session.progress);
  result.map.source = fmt::format("{} {}", scan.info.format, options.input);

  const auto write_start = Clock::now();
  write_body_map(result.map, options.output);
  if (!options.preview.empty())
    write_preview(result.map, options.window == "paper" ? PreviewWindow::paper : PreviewWindow::automatic,
                  options.preview);
  const double write_ms = ms_since(write_start), total_ms = ms_since(start);
  session.print(
      json_of(options, geometry, load_timings, result.kernel_ms, write_ms, total_ms),
      fmt::format(
          "{}: {} layers of {} angles x {} slices, radius {:.1f} mm about ({:.1f}, {:.1f}) mm, opacity {}\n"
          "read {:.0f} ms, upload {:.0f} ms, kernel {:.0f} ms, write {:.0f} ms, total {:.0f} ms\n",
          options.output, geometry.layers(), geometry.width, geometry.height, geometry.radius_mm(),
          outline.centre_mm.x, outline.centre_mm.y,
          std::visit([](const auto& a) { return a.name(); }, attenuation), load_timings.read_ms,
          load_timings.upload_ms, result.kernel_ms, write_ms, total_ms));
}

}  // namespace

void add_cast(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      add_command(app, session, "cast", "Cast a scan into a body map",
                  "  xraycast cast scans/chest/ -o chest.exr --preview chest.png\n"
                  "  xraycast cast chest.nii.gz -o chest.exr --layers 8 --opacity bilinear\n"
                  "  xraycast cast cta.nrrd -o cta.exr --opacity spectrum:80 --iodine vessels.nrrd\n"
                  "  xraycast cast head.nrrd -o head.exr --centre -3.5,12 --radius 110 --radii 0,40,80,110",
                  [options, &session] { cast_map(*options, session); });
  command->add_option("INPUT", options->input, "The scan: a folder or a file (see `xraycast info`)")
      ->required();
  command->add_option("-o,--output", options->output, "The body map, OpenEXR")
      ->required()
      ->type_name("MAP.exr");
  command->add_option("--projection", options->projection, "Along which rays: cylinder")
      ->check(CLI::IsMember({"cylinder"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--layers", options->layers, "Number of concentric shells (default 1)")->type_name("K");
  command
      ->add_option("--radii", options->radii,
                   "equal-area, equal-thickness, or all edges in mm, innermost first")
      ->capture_default_str()
      ->type_name("RULE|MM,MM,...");
  command->add_option("--angles", options->angles, "Rays around the axis; the map's width")
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--centre", options->centre, "The axis in mm; auto: the body's centroid")
      ->capture_default_str()
      ->type_name("auto|X,Y");
  command->add_option("--radius", options->radius, "The outermost radius in mm; auto: encloses the body")
      ->capture_default_str()
      ->type_name("auto|MM");
  add_attenuation_options(*command, options->attenuation);
  command->add_option("--preview", options->preview, "Also a picture of the layers, innermost on top")
      ->type_name("PNG");
  command
      ->add_option("--preview-window", options->window,
                   "auto: so that a person sees something; paper: exp(-tau), unscaled")
      ->check(CLI::IsMember({"auto", "paper"}))
      ->capture_default_str()
      ->type_name("auto|paper");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
