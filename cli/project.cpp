#include "attenuation.hpp"
#include "command.hpp"
#include "xraycast/atomic_file.hpp"
#include "xraycast/error.hpp"
#include "xraycast/projection_file.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <numbers>

namespace xraycast::cli {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

struct Options {
  std::string input, output, cone, size;
  ScanOptions scan;
  AttenuationOptions attenuation;
  double angle_deg = 0, tilt_deg = 0, pixel_mm = 0;
};

View parse_view(const Options& options) {
  View view;
  view.angle_rad = options.angle_deg * kRadians;
  view.tilt_rad = options.tilt_deg * kRadians;
  view.pixel_mm = options.pixel_mm;
  if (!options.cone.empty()) {
    const std::vector<double> cone = parse_numbers(options.cone, "--cone");
    if (cone.size() != 2)
      throw InputError("--cone {}: has to be SOURCE_AXIS_MM,SOURCE_DETECTOR_MM", options.cone);
    view.cone = Cone{cone[0], cone[1]};
  }
  if (!options.size.empty()) {
    const auto size = parse_sizes(options.size, 2, "--size");
    view.width = static_cast<int>(size[0]);
    view.height = static_cast<int>(size[1]);
  }
  return view;
}

void project_scan(const Options& options, Session& session) {
  const auto start = std::chrono::steady_clock::now();
  const auto attenuation = resolve(options.attenuation);
  check_projection_format(options.output);
  check_writable(options.output);
  View view = parse_view(options);
  const Scan scan = open_scan(options.input, options.scan, session.progress);
  session.say(scan.info.warnings);
  session.say(scan.info.notes);

  Device device(session.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings load_timings;
  const SpectralScan resident =
      load(device, scan, options.attenuation, finder, load_timings, session.progress);
  const VolumeGeometry& volume = resident.native.geometry();
  const BodyOutline body = finder.finish();
  view.centre_mm = {body.centre_mm, 0.5 * (volume.lower_mm().z + volume.upper_mm().z)};
  view = fitted(view, volume, body);
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  const ProjectionImage image =
      spectrum ? project(resident, view, *spectrum, session.progress)
               : project(resident.native, view, std::get<Opacity>(attenuation), session.progress);
  write_projection(image, options.output);

  const double total_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  const View& drawn = image.view;
  session.print({{"input", options.input},
                 {"image",
                  {{"width", drawn.width},
                   {"height", drawn.height},
                   {"pixel_mm", drawn.pixel_mm},
                   {"centre_mm", {drawn.centre_mm.x, drawn.centre_mm.y, drawn.centre_mm.z}},
                   {"angle_deg", options.angle_deg},
                   {"tilt_deg", options.tilt_deg}}},
                 {"timings_ms",
                  {{"read", load_timings.read_ms},
                   {"upload", load_timings.upload_ms},
                   {"kernel", image.kernel_ms},
                   {"total", total_ms}}}},
                fmt::format("{}: {}, {} x {} pixels of {:.3g} mm\nread {:.0f} ms, upload {:.0f} ms, kernel "
                            "{:.0f} ms, total {:.0f} ms\n",
                            options.output, label(drawn), drawn.width, drawn.height, drawn.pixel_mm,
                            load_timings.read_ms, load_timings.upload_ms, image.kernel_ms, total_ms));
}

}  // namespace

void add_project(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = add_command(
      app, session, "project", "The true projection of a scan (DRR)",
      "  xraycast project scans/chest/ -o ap.png --angle 0\n"
      "  xraycast project chest.nii.gz -o lao30.exr --angle 30 --tilt 10 --cone 1000,1500 --size 640x480",
      [options, &session] { project_scan(*options, session); });
  command->add_option("INPUT", options->input, "The scan: a folder or a file (see `xraycast info`)")
      ->required();
  command->add_option("-o,--output", options->output, ".exr, .tif, .nrrd hold float tau; .png what is shown")
      ->required()
      ->type_name("IMAGE");
  command
      ->add_option("--angle", options->angle_deg, "Where the detector stands: LAO is positive, 0 is frontal")
      ->capture_default_str()
      ->type_name("DEG");
  command->add_option("--tilt", options->tilt_deg, "Cranial is positive")
      ->capture_default_str()
      ->type_name("DEG");
  command
      ->add_option("--cone", options->cone,
                   "Distances from the source to axis and detector; without it the beam is parallel")
      ->type_name("MM,MM");
  command->add_option("--size", options->size, "Pixels; default: everything fits")->type_name("WxH");
  command
      ->add_option("--pixel", options->pixel_mm,
                   "Pixel size on the detector; default: as fine as the scan, or so that everything fits")
      ->check(CLI::PositiveNumber)
      ->type_name("MM");
  add_attenuation_options(*command, options->attenuation);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
