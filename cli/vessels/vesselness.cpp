#include "xraycast/segmentation/vesselness.hpp"

#include "options/command.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>

namespace xraycast::cli {
namespace {

struct Options {
  std::string input, output, scales = "0.8,1.2,1.8", measure = "jerman";
  double contrast_hu = VesselnessOptions{}.contrast_hu;
  ScanOptions scan;
};

VesselnessOptions parsed(const Options& options) {
  constexpr std::size_t kMaxScales = 16;
  constexpr double kMin_mm = 0.1, kMax_mm = 20;
  VesselnessOptions result;
  result.measure = options.measure == "frangi" ? VesselnessMeasure::frangi : VesselnessMeasure::jerman;
  result.scales_mm = parse_numbers(options.scales, "--scales");
  if (result.scales_mm.size() > kMaxScales)
    throw InputError("--scales {}: must be at most {} scales", options.scales, kMaxScales);
  for (const double scale_mm : result.scales_mm)
    if (scale_mm < kMin_mm || scale_mm > kMax_mm)
      throw InputError("--scales {}: {} mm must be from {} to {} mm, about the radius of a vessel",
                       options.scales, scale_mm, kMin_mm, kMax_mm);
  if (!(options.contrast_hu > 0) || options.contrast_hu > 32767)
    throw InputError("--contrast {}: must be above 0 HU, up to 32767", options.contrast_hu);
  result.contrast_hu = options.contrast_hu;
  return result;
}

void write_vesselness(const Options& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  const VesselnessOptions filter = parsed(options);
  check_volume_format(options.output);
  check_writable(options.output);
  const Scan scan = open_scan(options.input, options.scan, invocation.progress);
  invocation.say_about(scan.info);
  const Volume volume = collect(*scan.source, invocation.progress, options.input);
  invocation.say_about(*scan.source);
  ComputeDevice device(invocation.device);
  const VolumeGeometry& g = volume.geometry();
  write_field(g, vesselness(volume, filter, device, invocation.progress), options.output,
              invocation.progress);

  const double total_ms = stopwatch.ms();
  invocation.report(
      {{"input", options.input},
       {"output", options.output},
       {"volume", to_json(g)},
       {"measure", options.measure},
       {"scales_mm", filter.scales_mm},
       {"timings_ms", {{"total", total_ms}}}},
      fmt::format("{}: vesselness of {} x {} x {} voxels at scales of {:g} mm, {:.0f} ms\n", options.output,
                  g.size.x, g.size.y, g.size.z, fmt::join(filter.scales_mm, ", "), total_ms));
}

}  // namespace

void add_vesselness(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      add_command(app, invocation, "vesselness", "Enhance the vessels of a CT angiography (Hessian filter)",
                  "  xraycast vesselness cta.nii.gz -o vesselness.nrrd\n"
                  "  xraycast vesselness cta.nii.gz -o fine.nrrd --scales 0.5,0.7,1\n"
                  "  xraycast vesselness cta.nii.gz -o frangi.nii.gz --measure frangi --contrast 400",
                  [options, &invocation] { write_vesselness(*options, invocation); });
  add_scan_argument(*command, options->input);
  command->add_option("-o,--output", options->output, "Float, 0 to 1; .nrrd, .nii, .nii.gz, .mha or .mhd")
      ->required()
      ->type_name("VOLUME");
  command
      ->add_option("--scales", options->scales,
                   "Standard deviations of the filter, about the radii of the vessels")
      ->capture_default_str()
      ->type_name("MM,MM,...");
  command
      ->add_option("--measure", options->measure,
                   "jerman (2016): uniform response along a vessel; frangi (1998)")
      ->check(CLI::IsMember({"jerman", "frangi"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--contrast", options->contrast_hu,
                   "Contrast of the vessels to their surroundings; much weaker structures are suppressed")
      ->capture_default_str()
      ->type_name("HU");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
