#include "options/command.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/reports/step_report.hpp"
#include "xraycast/reports/vessel_report.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/vessels.hpp"
#include "xraycast/series/seg_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct SegmentArguments {
  std::string input, folder, explain, from_mask, window = "auto", surface = "isosurface", root;
  std::vector<std::string> seeds, not_vessels;
  ScanOptions scan;
  SegmentRequest request;
};

std::vector<glm::dvec3> points_of(const std::vector<std::string>& texts, const std::string& option) {
  std::vector<glm::dvec3> points_mm;
  for (const std::string& text : texts) points_mm.push_back(parse_point(text, option));
  return points_mm;
}

SegmentRequest parsed(const SegmentArguments& options) {
  SegmentRequest request = options.request;
  request.markers.vessels_mm = points_of(options.seeds, "--seed");
  request.markers.not_vessels_mm = points_of(options.not_vessels, "--not");
  if (options.window != "auto") {
    const std::vector<double> limits = parse_numbers(options.window, "--window");
    if (limits.size() != 2)
      throw InputError("--window {}: must be auto or LO,HI in HU, the lower one first", options.window);
    request.window_hu = {limits[0], limits[1]};
  }
  if (!options.from_mask.empty()) request.from_mask = fs::path(options.from_mask);
  if (!options.root.empty()) request.root_mm = parse_point(options.root, "--root");
  request.surface = surface_kind(options.surface);
  check(request);
  return request;
}

/// Makes the folder of --explain, without the files that an earlier run left. Throws InputError.
void prepare(const fs::path& folder) {
  constexpr std::array kSteps{"window",          "body", "bone",      "chambers", "evidence",
                              "trabecular-bone", "gaps", "selection", "filling"};
  constexpr std::array kFormerSteps{"ridges", "lumen"};
  make_folder(folder, "--explain " + folder.string());
  std::vector<std::string> names{"steps.png"};
  for (std::size_t number = 1; number <= kSteps.size(); ++number)
    for (const char* const step : kSteps) names.push_back(fmt::format("{}-{}.nrrd", number, step));
  for (std::size_t number = 1; number <= kFormerSteps.size(); ++number)
    names.push_back(fmt::format("{}-{}.nrrd", number, kFormerSteps[number - 1]));
  for (const std::string& name : names) {
    std::error_code error;
    fs::remove(folder / name, error);
    if (error)
      throw InputError("{}: the file of an earlier run cannot be removed: {}; delete it",
                       (folder / name).string(), error.message());
  }
}

/// The vessels, with masks and a picture of the steps up to a failing one where --explain asks for them.
Vessels explained(const Volume& volume, SegmentRequest request, const SegmentArguments& options,
                  Invocation& invocation) {
  ComputeDevice device(invocation.device);
  const OutputSeries masks;
  StepReport steps;
  const fs::path folder = options.explain;
  if (!options.explain.empty()) {
    prepare(folder);
    request.explain = [&](const std::string& step, const Mask& mask) {
      write_mask(mask.geometry, mask.voxels, folder / fmt::format("{}-{}.nrrd", steps.add(step, mask), step));
    };
  }
  const auto finish = [&] {
    if (!steps.is_empty()) write_picture(steps.picture(volume), folder / "steps.png");
  };
  try {
    Vessels vessels = find_vessels(volume, request, options.input, device, invocation.progress);
    finish();
    return vessels;
  } catch (const InputError&) {
    finish();
    throw;
  }
}

/// All files or none: a mask beside another scan's report would be misleading.
void write_all(Vessels& vessels, const ScanInfo& scan, const Volume& volume, const SegmentRequest& request,
               const SegmentArguments& options, const Invocation& invocation) {
  make_folder(options.folder, "-o " + options.folder);
  OutputSet outputs;
  take_names(vessels,
             write_vessels(vessels, scan, request.is_automatic(), options.folder, invocation.progress));
  write_picture(vessel_report(options.input, vessels, request, volume),
                fs::path(options.folder) / "report.png");
  outputs.commit();
}

/// Text on how several components of the mask were linked to one tree.
std::string linked(const Centrelines& found) {
  std::string words;
  if (found.gaps_mm.size() == 1)
    words = fmt::format(", one gap of {:.0f} mm closed", found.gaps_mm.front());
  else if (!found.gaps_mm.empty())
    words = fmt::format(", {} gaps of up to {:.0f} mm closed", found.gaps_mm.size(),
                        std::ranges::max(found.gaps_mm));
  if (found.parts_left_out > 0)
    words += fmt::format(", {} of the mask left out, too far away to be linked",
                         pluralize(found.parts_left_out, "component"));
  return words;
}

/// What is to be known of mask.seg.dcm, in a line.
std::string seg_note(const ScanInfo& scan, const std::string& why_none) {
  if (!why_none.empty()) return fmt::format("no {}: {}\n", kVesselSegFile, why_none);
  if (frame_of_reference_uid(scan).empty())
    return fmt::format(
        "{}: has its own frame of reference, because the slices have none in common; some viewers will not "
        "overlay it on them\n",
        kVesselSegFile);
  return "";
}

void report_vessels(const Vessels& found, const ScanInfo& scan, const SegmentArguments& options,
                    double total_ms, const Invocation& invocation) {
  const fs::path folder = options.folder;
  const Centrelines& centrelines = found.centrelines;
  const SegmentLog& log = found.log;
  const std::string why_none = why_no_seg(scan);
  invocation.say(found.notes);
  invocation.report({{"input", options.input},
                     {"folder", options.folder},
                     {"seg", why_none.empty() ? Json((folder / kVesselSegFile).string()) : Json()},
                     {"no_seg", why_none.empty() ? Json() : Json(why_none)},
                     {"voxels", found.mask.count()},
                     {"lumen_mm3", found.fill.volume_mm3()},
                     {"evidence", log.scale ? Json{{"lumen_hu", log.scale->lumen_hu},
                                                   {"noise_hu", log.scale->noise_hu},
                                                   {"blur_vox", log.scale->blur_vox}}
                                            : Json()},
                     {"window_hu", log.window ? Json{log.window->low_hu, log.window->high_hu} : Json()},
                     {"noise_hu", log.noise_hu},
                     {"weak_share", found.weak_fraction},
                     {"branches", centrelines.tree.branches().size()},
                     {"loops", centrelines.loops},
                     {"gaps_mm", centrelines.gaps_mm},
                     {"parts_left_out", centrelines.parts_left_out},
                     {"triangles", found.surface.triangles.size()},
                     {"timings_ms", {{"total", total_ms}}}},
                    fmt::format("{}: {}{}, {} triangles, {:.0f} ms; check {}\n{}", options.folder,
                                counts_of(centrelines), linked(centrelines), found.surface.triangles.size(),
                                total_ms, (folder / "report.png").string(), seg_note(scan, why_none)));
}

void segment(const SegmentArguments& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  const SegmentRequest request = parsed(options);
  std::vector<const char*> files(kVesselFiles.begin(), kVesselFiles.end());
  files.push_back("report.png");
  check_folder(options.folder, files, "-o " + options.folder);
  check_names(options.folder);
  const Scan scan = open_scan(options.input, options.scan, invocation.progress);
  invocation.say_about(scan.info);
  const Volume volume = collect(*scan.source, invocation.progress, options.input);
  invocation.say_about(*scan.source);
  Vessels vessels = explained(volume, request, options, invocation);
  write_all(vessels, scan.info, volume, request, options, invocation);
  report_vessels(vessels, scan.info, options, stopwatch.ms(), invocation);
}

}  // namespace

void add_segment(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<SegmentArguments>();
  CLI::App* command = add_command(
      app, invocation, "segment", "Segment the vessels of a CT angiography: mask, centrelines and surface",
      "  xraycast segment cta.nii.gz -o vessels\n"
      "  xraycast segment cta.nii.gz -o aorta --seed 12.5,-170,690 --not 30,-200,640\n"
      "  xraycast segment cta.nii.gz -o vessels --window 200,600 --surface tubes\n"
      "  xraycast segment cta.nii.gz -o vessels --from-mask mine.nrrd",
      [options, &invocation] { segment(*options, invocation); });
  add_scan_argument(*command, options->input);
  command
      ->add_option(
          "-o,--output", options->folder,
          "Folder for the mask, the vessel tree, the surface and the report; for a DICOM series also "
          "mask.seg.dcm, a DICOM Segmentation of its slices")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--seed", options->seeds,
                   "A point in a vessel to segment, mm (LPS); repeatable; without it, the largest vessels")
      ->type_name("X,Y,Z");
  command
      ->add_option("--not", options->not_vessels,
                   "A point in a structure to exclude, such as a vein that touches an artery; repeatable")
      ->type_name("X,Y,Z");
  command
      ->add_option("--max-radius", options->request.markers.max_radius_mm,
                   "Largest radius of a vessel; a structure in which a larger sphere fits is excluded as a "
                   "heart chamber")
      ->capture_default_str()
      ->type_name("MM");
  command
      ->add_option("--window", options->window,
                   "Range of CT numbers of the vessels in HU; auto: from the histogram")
      ->capture_default_str()
      ->type_name("auto|LO,HI");
  command
      ->add_option("--explain", options->explain,
                   "Folder for the mask after each step, and a picture of what each step removed")
      ->type_name("DIR");
  command
      ->add_option("--from-mask", options->from_mask, "Start from a mask of the vessels, on the scan's grid")
      ->excludes("--explain")
      ->type_name("MASK");
  command
      ->add_option("--root", options->root,
                   "The tree's root is the vessel end nearest to this point, mm (LPS); without it, the "
                   "thickest end of a vessel that is much longer than wide")
      ->type_name("X,Y,Z");
  command
      ->add_option("--surface", options->surface,
                   "isosurface: of the smoothed mask; tubes: swept along the centrelines")
      ->capture_default_str()
      ->type_name("isosurface|tubes");
  command
      ->add_option("--triangles", options->request.triangles,
                   "Approximate number of triangles of the surface")
      ->capture_default_str()
      ->type_name("N");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
