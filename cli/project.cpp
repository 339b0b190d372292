#include "options/attenuation_options.hpp"
#include "options/command.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/motion_options.hpp"
#include "options/scene_options.hpp"
#include "options/view_options.hpp"
#include "xraycast/acquisition/frame_file.hpp"
#include "xraycast/acquisition/scan_acquisition.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/projection/projection_file.hpp"

#include <fmt/format.h>

#include <memory>

namespace xraycast::cli {
namespace {

struct ProjectArguments {
  std::string input, output;
  ScanOptions scan;
  MotionOptions motion;
  AttenuationOptions attenuation;
  ViewOptions view;
  GreyOptions grey;
  DicomOptions dicom;
  FluoroscopeArguments fluoroscope;
  std::vector<std::string> objects;
};

void project_scan(const ProjectArguments& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  const Attenuation attenuation = attenuation_named(options.attenuation.opacity);
  check_iodine(options.attenuation.iodine, attenuation);
  check_projection_format(options.output);
  check_shown(options.grey, options.output);
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  AcquisitionOptions acquisition{.fluoroscope = parse_fluoroscope(options.fluoroscope)};
  if (acquisition.fluoroscope) check_linear_codes(options.dicom);
  if (acquisition.fluoroscope && spectrum)
    use_spectrum(options.attenuation.opacity, *spectrum, *acquisition.fluoroscope);
  XaOptions xa = parse_xa(options.dicom, options.output);
  check_writable(options.output);
  const std::vector<Implant> implants = open_objects(parse_objects(options.objects), invocation);
  View view = on_c_arm(options.fluoroscope.request, parse_view(options.view));
  check_dicom(view, xa, options.output, invocation);
  const MotionOfRequest motion = held_motion(parse_motion(options.motion));
  const Scan scan =
      moved(open_scan(options.input, options.scan, invocation.progress), motion, invocation.progress);
  invocation.say_about(scan.info);

  xa.frame_of_reference_uid = frame_of_reference_for(xa.patient, frame_of_reference_uid(scan.info));
  ComputeDevice device(invocation.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings load_timings;
  const SpectralScan resident = load(device, *scan.source, options.attenuation.iodine, finder, load_timings,
                                     invocation.progress, motion.held);
  invocation.say_about(*scan.source);
  invocation.say(opacity_hints(attenuation, scan.source->hu_range()));
  const VolumeGeometry& volume = resident.native.geometry();
  const BodyOutline body = finder.finish();
  const double top_mm = volume.upper_mm().z, bottom_mm = volume.lower_mm().z;
  view.centre_mm = isocentre_mm(options.view, {.centre_mm = {body.centre_mm, 0.5 * (bottom_mm + top_mm)},
                                               .radius_mm = body.radius_mm,
                                               .half_height_mm = 0.5 * (top_mm - bottom_mm)});
  view = fitted(view, volume, body);
  if (is_source_within(view, volume, body))
    invocation.say(
        {"the X-ray source lies inside the body, so the tissue behind it is not in the picture; increase the "
         "first distance of --cone"});
  if (spectrum) xa.tube_kvp = tube_kvp(options.attenuation.opacity, *spectrum);
  if (acquisition.fluoroscope && !spectrum) note_on_energies(invocation);
  ScanAcquisition frames({.scan = resident, .attenuation = attenuation, .implants = implants}, acquisition,
                         view);
  const AcquiredFrame frame = frames.frame(view, invocation.progress);
  const auto exposure = frames.acquisition().record();
  note_on_saturation(frames.acquisition().is_saturated(), invocation);
  FrameFile file(options.output, {}, view, acquisition, xa);
  file.add(frame, display_of(options.grey));
  file.finish(exposure);

  const double total_ms = stopwatch.ms();
  Json result{{"input", options.input},
              {"image", to_json(view)},
              {"timings_ms",
               {{"read", load_timings.read_ms},
                {"upload", load_timings.upload_ms},
                {"kernel", frames.kernel_ms()},
                {"total", total_ms}}}};
  if (!motion.phases.empty()) result["motion"] = to_json(motion);
  if (is_xa(options.output)) result["frame_of_reference"] = frame_of_reference_name(xa);
  if (exposure) result["fluoroscope"] = to_json(*exposure);
  invocation.report(
      result, fmt::format("{}: {}{}, {} x {} pixels of {:.3g} mm\nread {:.0f} ms, upload {:.0f} ms, kernel "
                          "{:.0f} ms, total {:.0f} ms\n{}",
                          options.output, label(view), motion.suffix(), view.width, view.height,
                          view.pixel_mm, load_timings.read_ms, load_timings.upload_ms, frames.kernel_ms(),
                          total_ms, exposure ? summary(*exposure) : ""));
}

}  // namespace

void add_project(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<ProjectArguments>();
  CLI::App* command = add_command(
      app, invocation, "project", "Draw the DRR of a scan, its true projection",
      "  xraycast project scans/chest/ -o ap.png --angle 0 --inverted\n"
      "  xraycast project chest.nii.gz -o lao30.exr --angle 30 --tilt 10 --cone 1000,1500 --size 640x480\n"
      "  xraycast project scans/chest/ -o lao30.dcm --angle 30 --cone 780,1200 --patient Phantom,1\n"
      "  xraycast project scans/chest/ -o inhaled.png --motion motion.json --phase breath=1\n"
      "  xraycast project scans/chest/ -o fluoro.png --c-arm fixed-single-plane --field 220 --dose low\n"
      "  xraycast project scans/hip/ -o hip.png --object stem.stl,material=titanium-alloy",
      [options, &invocation] { project_scan(*options, invocation); });
  add_scan_argument(*command, options->input);
  command
      ->add_option("-o,--output", options->output,
                   ".exr, .tif and .nrrd hold float optical depths, or a fluoroscope's raw signal in keV; "
                   ".dcm a DICOM XA image; .png, .jpg, .webp and others the displayed picture")
      ->required()
      ->type_name("IMAGE");
  add_view_options(*command, options->view);
  add_motion_options(*command, options->motion);
  add_object_option(*command, options->objects);
  add_grey_options(*command, options->grey);
  add_dicom_options(*command, options->dicom);
  add_attenuation_options(*command, options->attenuation);
  add_fluoroscope_options(*command, options->fluoroscope);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
