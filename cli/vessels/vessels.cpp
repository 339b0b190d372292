#include "options/command.hpp"
#include "vessels/scan_beside.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/given_vessels/given_vessels.hpp"
#include "xraycast/reports/vessel_report.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/series/seg_file.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct VesselsArguments {
  std::string input, folder, like, unit = "mm", frame = "lps", root, component;
  std::vector<std::string> labels;
  std::optional<double> radius_mm;
  std::size_t triangles = GivenVesselsOptions{}.triangles;
  ScanOptions scan;
};

GivenVesselsRequest parsed(const VesselsArguments& options) {
  GivenVesselsRequest request;
  request.input = options.input;
  request.unit_mm = unit_mm(options.unit);
  request.frame = patient_frame(options.frame);
  request.labels = options.labels;
  request.radius_mm = options.radius_mm;
  if (!options.root.empty()) request.options.root_mm = parse_point(options.root, "--root");
  if (!options.component.empty())
    request.options.component_mm = parse_point(options.component, "--component");
  request.options.triangles = options.triangles;
  check(request);
  return request;
}

/// All files or none: a tree beside other vessels' report would be misleading.
void write_all(Vessels& vessels, const ScanBeside& like, const VesselsArguments& options,
               const Invocation& invocation) {
  make_folder(options.folder, "-o " + options.folder);
  OutputSet outputs;
  const std::string origin = options.like.empty() ? "as given" : "as given, over " + options.like;
  constexpr bool kIsAutomatic = false;
  take_names(vessels, write_vessels(vessels, like.info, kIsAutomatic, options.folder, invocation.progress));
  write_picture(given_vessel_report(options.input, vessels, origin, like.voxels()),
                fs::path(options.folder) / "report.png");
  outputs.commit();
}

void report_vessels(const Vessels& found, const VesselsArguments& options, double total_ms,
                    const Invocation& invocation) {
  const Centrelines& centrelines = found.centrelines;
  invocation.say(found.notes);
  invocation.report({{"input", options.input},
                     {"folder", options.folder},
                     {"branches", centrelines.tree.branches().size()},
                     {"loops", centrelines.loops},
                     {"triangles", found.surface.triangles.size()},
                     {"notes", found.notes},
                     {"timings_ms", {{"total", total_ms}}}},
                    fmt::format("{}: {}, {} triangles, {:.0f} ms; check {}\n", options.folder,
                                counts_of(centrelines), found.surface.triangles.size(), total_ms,
                                (fs::path(options.folder) / "report.png").string()));
}

void vessels(const VesselsArguments& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  const GivenVesselsRequest request = parsed(options);
  std::vector<const char*> files(kVesselFiles.begin(), kVesselFiles.end());
  files.push_back("report.png");
  check_folder(options.folder, files, "-o " + options.folder);
  check_names(options.folder);
  const ScanBeside like = read_scan_beside(options.like, options.scan, invocation);
  Vessels found = given_vessels(request, like.voxels(), invocation.progress);
  write_all(found, like, options, invocation);
  report_vessels(found, options, stopwatch.ms(), invocation);
}

}  // namespace

void add_vessels(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<VesselsArguments>();
  CLI::App* command = add_command(
      app, invocation, "vessels",
      "Make the folder of vessels that `segment` makes from a surface, a mask or centrelines",
      "  xraycast vessels printed.stl -o vessels --unit cm --frame ras\n"
      "  xraycast vessels aorta.nii.gz -o vessels --like cta.nii.gz\n"
      "  xraycast vessels totalsegmentator/ -o vessels --label aorta,iliac_artery_left,iliac_artery_right\n"
      "  xraycast vessels centerlines.vtp -o vessels",
      [options, &invocation] { vessels(*options, invocation); });
  command
      ->add_option(
          "INPUT", options->input,
          "A surface (.stl, .vtp, .vtk, .obj, .ply), closed or open at the vessels' ends; a mask (any "
          "scan's format, or a DICOM Segmentation), or a folder of masks; centrelines with radii (.vtp, "
          ".vtk, .mrk.json, .swc, "
          ".csv, .json)")
      ->required();
  command
      ->add_option("-o,--output", options->folder,
                   "Folder for the vessel tree, the surface and the report; with --like, or of a mask, also "
                   "masks")
      ->required()
      ->type_name("DIR");
  command
      ->add_option(
          "--like", options->like,
          "The scan that the vessels are of: their mask is made on its grid, and the report shows it")
      ->type_name("SCAN");
  command->add_option("--unit", options->unit, "Unit of a surface's or a centreline's lengths")
      ->capture_default_str()
      ->type_name("mm|cm|m|um");
  command
      ->add_option(
          "--frame", options->frame,
          "Frame of a surface or a centreline: x to the patient's left and y to the back (lps), or to "
          "the right and to the front (ras). A file that says its own is believed")
      ->capture_default_str()
      ->type_name("lps|ras");
  command
      ->add_option(
          "--label", options->labels,
          "Structures of a mask that are vessels: numbers, TotalSegmentator's names, a DICOM Segmentation's "
          "labels, or names of files in a folder; repeatable")
      ->delimiter(',')
      ->type_name("NAME");
  command->add_option("--radius", options->radius_mm, "Radius of centrelines without radii, mm")
      ->type_name("MM");
  command
      ->add_option(
          "--component", options->component,
          "Of components that do not touch, keep the nearest to this point, mm (LPS); without it, the "
          "largest")
      ->type_name("X,Y,Z");
  command
      ->add_option("--root", options->root,
                   "The tree's root is the vessel end nearest to this point, mm (LPS); without it, the "
                   "thickest end of a vessel that is much longer than wide, or where centrelines start")
      ->type_name("X,Y,Z");
  command
      ->add_option("--triangles", options->triangles,
                   "Approximate number of triangles of a surface that is made anew")
      ->capture_default_str()
      ->type_name("N");
}

}  // namespace xraycast::cli
