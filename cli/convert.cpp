#include "options/command.hpp"
#include "options/view_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/series/ct_series.hpp"

#include <fmt/format.h>

#include <memory>

namespace xraycast::cli {
namespace {

struct ConvertArguments {
  std::string input, output, patient;
  ScanOptions scan;
};

void convert(const ConvertArguments& options, Session& session) {
  const bool is_series = is_ct_series(options.output);
  if (!is_series) {
    if (!options.patient.empty())
      throw InputError("--patient does not apply to {}, which is not DICOM; leave it out or name a folder",
                       options.output);
    check_volume_format(options.output);
    check_writable(options.output);
  }
  const DicomPatient patient = parse_patient(options.patient, "--patient");
  const Scan scan = open_scan(options.input, options.scan, session.progress);
  session.say_about(scan.info);
  if (is_series) check_ct_series(scan.source->geometry(), options.output, patient);

  const Volume volume = collect(*scan.source, session.progress, options.input);
  session.say_about(*scan.source);
  const std::string frame_uid = frame_of_reference_for(patient, frame_of_reference_uid(scan.info));
  if (is_series)
    write_ct_series(volume, options.output, patient, {options.input, frame_uid}, session.progress);
  else
    write_volume(volume, options.output, session.progress);

  Json json{
      {"input", options.input}, {"output", options.output}, {"volume", cli::to_json(volume.geometry())}};
  if (is_series) json["frame_of_reference"] = frame_uid.empty() ? "new" : "scan";
  const Index3& size = volume.geometry().size;
  const glm::dvec3& spacing_mm = volume.geometry().spacing_mm;
  session.report(json, fmt::format("{}: {} x {} x {} voxels of {:.3g} x {:.3g} x {:.3g} mm{}\n",
                                   options.output, size.x, size.y, size.z, spacing_mm.x, spacing_mm.y,
                                   spacing_mm.z, is_series ? ", a DICOM series" : ""));
}

}  // namespace

void add_convert(CLI::App& app, Session& session) {
  const auto options = std::make_shared<ConvertArguments>();
  CLI::App* command =
      add_command(app, session, "convert", "Write a scan as a DICOM series, NIfTI, NRRD or MetaImage",
                  "  xraycast convert scans/chest/ -o chest.nii.gz\n"
                  "  xraycast convert thorax.nrrd -o thorax-dicom/ --patient Phantom,1",
                  [options, &session] { convert(*options, session); });
  add_scan_argument(*command, options->input);
  command
      ->add_option("-o,--output", options->output,
                   "A new folder for a DICOM CT series, or a file .nii, .nii.gz, .nrrd, .mha or .mhd")
      ->required()
      ->type_name("FOLDER|FILE");
  add_patient_option(*command, options->patient);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
