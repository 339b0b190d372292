#include "attenuation.hpp"
#include "options/command.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/view_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/projection_file.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <memory>

namespace xraycast::cli {
namespace {

struct ProjectArguments {
  std::string input, output;
  ScanOptions scan;
  AttenuationOptions attenuation;
  ViewOptions view;
  GreyOptions grey;
  DicomOptions dicom;
  FluoroscopeArguments fluoroscope;
};

bool is_source_within(const View& view, const VolumeGeometry& volume, const BodyOutline& body) {
  if (!view.cone) return false;
  const glm::dvec3 source_mm = view.source_mm();
  return glm::distance(glm::dvec2(source_mm), body.centre_mm) < body.radius_mm &&
         source_mm.z > volume.lower_mm().z && source_mm.z < volume.upper_mm().z;
}

/// A scan's picture, and with a fluoroscope one pulse of it.
struct ProjectedPicture {
  View view;
  double kernel_ms = 0;
  ProjectionImage drr;
  std::optional<Fluoroscope> fluoroscope;
  FluoroscopyFrame frame;
};

ProjectedPicture project_drr(const SpectralScan& scan, const View& view,
                             const std::variant<Opacity, Spectrum>& attenuation, Progress& progress) {
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  ProjectedPicture picture;
  picture.drr = spectrum ? project(scan, view, *spectrum, progress)
                         // One picture takes less time than finding the constant blocks of the scan.
                         : project(scan.native, view, std::get<Opacity>(attenuation), progress, {},
                                   Sampling::everywhere);
  picture.view = picture.drr.view;
  picture.kernel_ms = picture.drr.kernel_ms;
  return picture;
}

ProjectedPicture project_fluoroscopy(const SpectralScan& scan, const View& view,
                                     const std::variant<Opacity, Spectrum>& attenuation,
                                     const FluoroscopyOptions& options, const Session& session,
                                     Progress& progress) {
  const auto expose = [&](const auto& rays, const WaterPath& path, double kernel_ms) {
    ProjectedPicture picture{view, kernel_ms, {}, Fluoroscope(options, view, path), {}};
    picture.fluoroscope->settle(rays);
    picture.frame = picture.fluoroscope->expose(rays);
    return picture;
  };
  if (const auto* spectrum = std::get_if<Spectrum>(&attenuation)) {
    const ProjectedMasses masses = project_masses(scan, view, progress);
    return expose(masses.g_cm2, WaterPath(*spectrum), masses.kernel_ms);
  }
  note_on_energies(session);
  const auto& opacity = std::get<Opacity>(attenuation);
  const ProjectionImage drr = project(scan.native, view, opacity, progress, {}, Sampling::everywhere);
  return expose(std::span(drr.tau), WaterPath(opacity), drr.kernel_ms);
}

void project_scan(const ProjectArguments& options, Session& session) {
  const Stopwatch stopwatch;
  const auto attenuation = resolve(options.attenuation);
  check_projection_format(options.output);
  check_shown(options.grey, options.output);
  auto fluoroscopy = parse_fluoroscope(options.fluoroscope);
  if (fluoroscopy) {
    check_linear_codes(options.dicom);
    use_spectrum(options.attenuation.opacity, attenuation, *fluoroscopy);
  }
  XaOptions xa = parse_xa(options.dicom, options.output);
  check_writable(options.output);
  View view = on_c_arm(options.fluoroscope, fluoroscopy, parse_view(options.view));
  check_dicom(view, xa, options.output, session);
  const Scan scan = open_scan(options.input, options.scan, session.progress);
  session.say_about(scan.info);

  xa.frame_of_reference_uid = frame_of_reference_for(xa.patient, frame_of_reference_uid(scan.info));
  ComputeDevice device(session.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings load_timings;
  const SpectralScan resident =
      load(device, scan, options.attenuation, finder, load_timings, session.progress);
  hint_at_opacity(attenuation, scan.source->hu_range(), session);
  const VolumeGeometry& volume = resident.native.geometry();
  const BodyOutline body = finder.finish();
  const double top_mm = volume.upper_mm().z, bottom_mm = volume.lower_mm().z;
  view.centre_mm = isocentre_mm(options.view, {.centre_mm = {body.centre_mm, 0.5 * (bottom_mm + top_mm)},
                                               .radius_mm = body.radius_mm,
                                               .half_height_mm = 0.5 * (top_mm - bottom_mm)});
  view = fitted(view, volume, body);
  if (is_source_within(view, volume, body))
    session.say(
        {"the X-ray source lies inside the body, so the tissue behind it is not in the picture; increase the "
         "first distance of --cone"});
  xa.tube_kvp = tube_kvp(options.attenuation.opacity, attenuation);
  const ProjectedPicture picture =
      fluoroscopy ? project_fluoroscopy(resident, view, attenuation, *fluoroscopy, session, session.progress)
                  : project_drr(resident, view, attenuation, session.progress);
  note_on_saturation(picture.frame.is_saturated, session);
  if (picture.fluoroscope)
    write_fluoroscopy(*picture.fluoroscope, picture.frame, view, options.output, options.grey, xa);
  else
    write_projection(picture.drr, options.output, options.grey.gamma.value_or(1), options.grey.inverted, xa);

  const double total_ms = stopwatch.ms();
  const View& drawn = picture.view;
  Json result{{"input", options.input},
              {"image", to_json(drawn)},
              {"timings_ms",
               {{"read", load_timings.read_ms},
                {"upload", load_timings.upload_ms},
                {"kernel", picture.kernel_ms},
                {"total", total_ms}}}};
  if (is_xa(options.output)) result["frame_of_reference"] = frame_of_reference_name(xa);
  if (picture.fluoroscope) result["fluoroscope"] = to_json(*picture.fluoroscope, picture.frame.technique);
  session.report(
      result, fmt::format("{}: {}, {} x {} pixels of {:.3g} mm\nread {:.0f} ms, upload {:.0f} ms, kernel "
                          "{:.0f} ms, total {:.0f} ms\n{}",
                          options.output, label(drawn), drawn.width, drawn.height, drawn.pixel_mm,
                          load_timings.read_ms, load_timings.upload_ms, picture.kernel_ms, total_ms,
                          picture.fluoroscope ? summary(*picture.fluoroscope, picture.frame.technique) : ""));
}

}  // namespace

void add_project(CLI::App& app, Session& session) {
  const auto options = std::make_shared<ProjectArguments>();
  CLI::App* command = add_command(
      app, session, "project", "Draw the DRR of a scan, its true projection",
      "  xraycast project scans/chest/ -o ap.png --angle 0 --inverted\n"
      "  xraycast project chest.nii.gz -o lao30.exr --angle 30 --tilt 10 --cone 1000,1500 --size 640x480\n"
      "  xraycast project scans/chest/ -o lao30.dcm --angle 30 --cone 780,1200 --patient Phantom,1\n"
      "  xraycast project scans/chest/ -o fluoro.png --c-arm fixed-single-plane --field 220 --dose low",
      [options, &session] { project_scan(*options, session); });
  add_scan_argument(*command, options->input);
  command
      ->add_option("-o,--output", options->output,
                   ".exr, .tif and .nrrd hold float optical depths, or a fluoroscope's raw signal in keV; "
                   ".dcm a DICOM XA image; .png, .jpg, .webp and others the displayed picture")
      ->required()
      ->type_name("IMAGE");
  add_view_options(*command, options->view);
  add_grey_options(*command, options->grey);
  add_dicom_options(*command, options->dicom);
  add_attenuation_options(*command, options->attenuation);
  add_fluoroscope_options(*command, options->fluoroscope);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
