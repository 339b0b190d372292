#include "xraycast/scan/convert.hpp"

#include "options/command.hpp"
#include "options/motion_options.hpp"
#include "options/view_options.hpp"

#include <fmt/format.h>

#include <memory>

namespace xraycast::cli {
namespace {

struct ConvertArguments {
  std::string input, output, patient;
  ScanOptions scan;
  MotionOptions motion;
};

void convert_scan(const ConvertArguments& options, Invocation& invocation) {
  const Converted made = convert({options.input, options.output, options.scan,
                                  parse_patient(options.patient, "--patient"), parse_motion(options.motion)},
                                 invocation.progress);
  invocation.say_about(made.info);
  invocation.say(made.voxel_warnings);
  Json json{{"input", options.input}, {"output", options.output}, {"volume", cli::to_json(made.geometry)}};
  if (!made.motion.phases.empty()) json["motion"] = to_json(made.motion);
  if (made.is_series) json["frame_of_reference"] = made.frame_of_reference_uid.empty() ? "new" : "scan";
  const Index3& size = made.geometry.size;
  const glm::dvec3& spacing_mm = made.geometry.spacing_mm;
  invocation.report(
      json, fmt::format("{}: {} x {} x {} voxels of {:.3g} x {:.3g} x {:.3g} mm{}{}\n", options.output,
                        size.x, size.y, size.z, spacing_mm.x, spacing_mm.y, spacing_mm.z,
                        made.motion.suffix(), made.is_series ? ", a DICOM series" : ""));
}

}  // namespace

void add_convert(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<ConvertArguments>();
  CLI::App* command =
      add_command(app, invocation, "convert", "Write a scan as a DICOM series, NIfTI, NRRD or MetaImage",
                  "  xraycast convert scans/chest/ -o chest.nii.gz\n"
                  "  xraycast convert thorax.nrrd -o thorax-dicom/ --patient Phantom,1\n"
                  "  xraycast convert chest.nii.gz -o inhaled.nii.gz --motion motion.json --phase breath=1",
                  [options, &invocation] { convert_scan(*options, invocation); });
  add_scan_argument(*command, options->input);
  command
      ->add_option("-o,--output", options->output,
                   "A new folder for a DICOM CT series, or a file .nii, .nii.gz, .nrrd, .mha or .mhd")
      ->required()
      ->type_name("FOLDER|FILE");
  add_patient_option(*command, options->patient);
  add_motion_options(*command, options->motion);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
